#include "tests/fuzz/sensor_game.h"

#include <cmath>

namespace plumb {
namespace {

bool Finite(std::span<const double> values) {
  return std::ranges::all_of(values, [](double value) { return std::isfinite(value); });
}

}  // namespace

SensorGame::SensorGame(std::unique_ptr<Sensor> host, std::unique_ptr<VirtualSensor> sensor,
                       Bytes& bytes)
    : bytes_(bytes),
      host_(std::move(host)),
      sensor_(std::move(sensor)),
      ids_(sensor_->ids()),
      filters_(host_->filters()),
      clean_((bytes.Byte() & 1) != 0) {}

void SensorGame::Play() {
  while (!bytes_.empty()) {
    Operate();
    CheckHost();
  }
  StartAnew();
}

void SensorGame::Operate() {
  const uint8_t operation = bytes_.Byte();
  switch (operation & 15) {
    case 0:
      return host_->Start(now_);
    case 1:
      accepted_ = operation < 64 ? FrameBatch::kCapacity : operation >> 7;
      return;
    case 2:
      return sensor_->Move(bytes_, clean_);
    case 3:
      surprised_ = true;
      return sensor_->Surprise(bytes_, now_);
    case 4:
    case 5:
    case 6:
      if (!clean_) TellHost(bytes_.AnyFrame(ids_));
      return;
    case 7:
      if (!clean_) sensor_->OnFrame(bytes_.AnyFrame(ids_), now_);
      return;
    case 8:
      if (!clean_) wire_.Spoil(bytes_);
      return;
    default: {
      const int64_t dt = bytes_.Pick(kSteps);
      for (int i = 0; i <= operation >> 4; ++i) Cycle(dt);
    }
  }
}

void SensorGame::Cycle(int64_t dt) {
  now_ += dt;
  sensor_->Turn(dt);
  said_.Clear();
  told_.Clear();
  sensor_->Tick(now_, said_);
  Require(sensor_->NextDue() > now_);
  for (const Frame& frame : said_.frames()) {
    Require(IsWellFormed(frame) && !frame.fd && !frame.extended && !frame.error);
    Require(std::ranges::any_of(filters_,
                                [&](const Filter& f) { return f.id == (frame.id & f.mask); }));
    wire_.Carry(frame, [this](const Frame& arrived) { TellHost(arrived); });
  }
  host_->Tick(now_, told_);
  for (const Frame& frame : told_.frames().first(std::min(accepted_, told_.size()))) {
    Require(IsWellFormed(frame));
    wire_.Carry(frame, [this](const Frame& arrived) { sensor_->OnFrame(arrived, now_); });
  }
  if (clean_) Require(sensor_->rejected() == 0);
  CheckHost();
}

void SensorGame::TellHost(const Frame& frame) {
  if (!IsWellFormed(frame)) return;
  const int64_t before = host_->imu() ? host_->imu()->sample_time : 0;
  const SensorUse use = host_->OnFrame(frame, now_);
  if (use == SensorUse::kReading) {
    ++readings_;
    Require(host_->state() == SensorState::kRunning);
    if (host_->imu()) Require(host_->imu()->sample_time >= before);
  }
  if (!clean_) return;
  if (use == SensorUse::kReading) Require(sensor_->Agrees(*host_));
  if (!surprised_) Require(use == SensorUse::kConsumed || use == SensorUse::kReading);
}

void SensorGame::CheckHost() {
  if (const EncoderReading* encoder = host_->encoder()) {
    Require(std::isfinite(encoder->position) && !std::isinf(encoder->velocity));
  }
  if (const ImuSample* imu = host_->imu()) {
    Require(Finite(imu->rate) && Finite(imu->force) && Finite(imu->orientation));
    double square = 0;
    for (const double q : imu->orientation) square += q * q;
    if (imu->orientation_valid) Require(std::abs(square - 1) < 1e-9);
  }
  Require((host_->state() == SensorState::kRunning) == host_->reason().empty());
  Require(std::ranges::all_of(host_->reason(), [](char c) { return c >= ' ' && c <= '~'; }));
  if (clean_ && !surprised_) Require(host_->incomplete() == 0);
}

// Whatever has happened: a sensor that is in order gives readings again, and right ones.
void SensorGame::StartAnew() {
  wire_.Mend();
  accepted_ = FrameBatch::kCapacity;
  sensor_->Heal();
  for (int i = 0; i < 15; ++i) Cycle(10'000);
  host_->Start(now_);
  const int64_t before = readings_;
  for (int i = 0; i < 80; ++i) Cycle(10'000);  // it may have to be told twice
  Require(host_->state() == SensorState::kRunning && readings_ > before + 10 &&
          sensor_->Agrees(*host_));
}

}  // namespace plumb
