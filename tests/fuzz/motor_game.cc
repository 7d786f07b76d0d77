#include "tests/fuzz/motor_game.h"

#include <cmath>

namespace plumb {
namespace {

bool NotInfinite(double value) { return !std::isinf(value); }

bool Active(DriveState state) {
  return state == DriveState::kArming || state == DriveState::kArmed;
}

}  // namespace

MotorGame::MotorGame(std::unique_ptr<Motor> motor, std::unique_ptr<VirtualDrive> drive,
                     Bytes& bytes)
    : bytes_(bytes),
      motor_(std::move(motor)),
      drive_(std::move(drive)),
      ids_(drive_->ids()),
      clean_((bytes.Byte() & 1) != 0),
      latency_(bytes.Byte() % 4) {}

void MotorGame::Play() {
  while (!bytes_.empty()) {
    Operate();
    CheckHost();
    CheckDrive();
  }
  ComeToRestAndArm();
}

void MotorGame::Operate() {
  const uint8_t operation = bytes_.Byte();
  switch (operation & 15) {
    case 0:
      return motor_->Arm(now_);
    case 1:
      return motor_->Disarm(now_);
    case 2:
      return motor_->Estop(now_);
    case 3:
      return SetTorque(bytes_.Number());
    case 4:
      accepted_ = operation < 64 ? FrameBatch::kCapacity : operation >> 6;
      return;
    case 5:
      may_arm_ = operation < 128;
      return;
    case 6:
      return drive_->Move(bytes_, clean_);
    case 7:
      return drive_->Surprise(bytes_, clean_, now_);
    case 8:
      if (!clean_) TellHost(bytes_.AnyFrame(ids_, drive_->fd()));
      return;
    case 9:
      if (!clean_) TellDrive(bytes_.AnyFrame(ids_, drive_->fd()));
      return;
    case 10:
      if (!clean_) wire_.Spoil(bytes_);
      return;
    default: {
      const int64_t dt = bytes_.Pick(kSteps);
      for (int i = 0; i <= operation >> 4; ++i) Cycle(dt);
    }
  }
}

// As the driver does it: receive, setpoint, Tick, send.
void MotorGame::Cycle(int64_t dt) {
  now_ += dt;
  ++cycle_;
  drive_->Turn(dt);
  said_.Clear();
  drive_->Tick(now_, said_);
  Require(drive_->NextDue() > now_);
  for (const Frame& frame : said_.frames()) {
    Require(IsWellFormed(frame) && !frame.error && (drive_->fd() || !frame.fd) &&
            frame.extended == (frame.id > 0x7FF));
    on_the_way_.push_back({frame, cycle_ + latency_});
  }
  while (!on_the_way_.empty() && on_the_way_.front().cycle <= cycle_) {
    wire_.Carry(on_the_way_.front().frame, [this](const Frame& arrived) { TellHost(arrived); });
    on_the_way_.pop_front();
  }
  CheckHost();

  told_.Clear();
  const DriveState state = motor_->state();
  if (Active(state)) told_.Push(motor_->Torque(state == DriveState::kArmed ? torque_ : 0));
  const size_t setpoints = told_.size();
  motor_->Tick(now_, may_arm_, told_);
  for (const Frame& frame : told_.frames().subspan(setpoints)) {
    Require(IsWellFormed(frame) && drive_->MayBeTold(frame, motor_->state()));
  }
  const size_t taken = std::min(accepted_, told_.size());
  for (const Frame& frame : told_.frames().first(taken)) {
    wire_.Carry(frame, [this](const Frame& arrived) { TellDrive(arrived); });
  }
  if (clean_ && setpoints == 1 && taken == 1 && drive_->armed()) {
    Require(drive_->Torque() == *drive_->TorqueIn(told_.frames()[0]));
  }
  motor_->Transmitted(taken == told_.size(), now_);
  CheckHost();
  CheckDrive();
}

void MotorGame::TellDrive(const Frame& frame) {
  drive_->OnFrame(frame, now_);
  CheckDrive();
}

void MotorGame::TellHost(const Frame& frame) {
  if (!IsWellFormed(frame)) return;
  const FrameUse use = motor_->OnFrame(frame, now_);
  if (clean_) Require(use == FrameUse::kConsumed || use == FrameUse::kEstimate);
  if (clean_ && latency_ == 0 && use == FrameUse::kEstimate)
    Require(drive_->Agrees(motor_->estimate()));
}

// Any number is a valid frame, of that torque or the nearest there is.
void MotorGame::SetTorque(double torque) {
  const Frame frame = motor_->Torque(torque);
  Require(IsWellFormed(frame));
  const std::optional<double> said = drive_->TorqueIn(frame);
  Require(said && std::isfinite(*said) && std::abs(*said) <= drive_->max_torque());
  if (!std::isfinite(torque)) return;
  torque_ = torque;
  if (motor_->state() != DriveState::kArmed || std::abs(torque) > drive_->max_torque()) return;
  Require(std::abs(*said - torque) <= drive_->Rounding(torque));
}

void MotorGame::CheckHost() {
  const MotorEstimate& estimate = motor_->estimate();
  Require(std::isfinite(estimate.position) && std::isfinite(estimate.velocity));
  const MotorReadings readings = motor_->readings();
  Require(NotInfinite(motor_->torque_estimate()) && NotInfinite(readings.motor_temperature) &&
          NotInfinite(readings.drive_temperature) && NotInfinite(readings.bus_voltage) &&
          NotInfinite(readings.bus_current));
  for (const std::string_view words : {motor_->reason(), motor_->identity()}) {
    Require(std::ranges::all_of(words, [](char c) { return c >= ' ' && c <= '~'; }));
  }
  if (motor_->state() == DriveState::kFault) Require(!motor_->reason().empty());
  if (Active(motor_->state())) Require(!motor_->confirmed_idle());
  if (clean_) Require(!(motor_->confirmed_idle() && drive_->armed()));
}

void MotorGame::CheckDrive() {
  const double torque = drive_->Torque();
  Require(std::isfinite(torque) && std::abs(torque) <= drive_->max_torque());
  if (!drive_->armed()) Require(torque == 0);
  if (clean_) Require(drive_->rejected() == 0);
}

// Whatever has happened: on a wire that is in order a drive obeys, and does what it is told.
void MotorGame::ComeToRestAndArm() {
  constexpr int64_t kStep = 10'000;
  const auto run = [this](int64_t duration) {
    for (const int64_t end = now_ + duration; now_ < end;) Cycle(kStep);
  };
  wire_.Mend();
  accepted_ = FrameBatch::kCapacity;
  may_arm_ = true;
  motor_->Disarm(now_);
  run(1'000'000);
  // A shaft that turns a thousand times within a cycle may look like a restart just now, which it
  // stops once more.
  for (int i = 0; i < 100 && !motor_->confirmed_idle(); ++i) Cycle(kStep);
  Require(motor_->confirmed_idle() && !drive_->armed());
  drive_->Heal();
  run(300'000);
  motor_->Arm(now_);
  for (int i = 0; i < 200 && motor_->state() != DriveState::kArmed; ++i) Cycle(kStep);
  Require(motor_->state() == DriveState::kArmed && drive_->armed() && !motor_->confirmed_idle());
  SetTorque(0.5 * std::min(drive_->max_torque(), 10.));
  run(20'000);
  Require(std::abs(drive_->Torque() - torque_) <= drive_->Rounding(torque_));
  motor_->Estop(now_);
  run(20'000);
  Require(drive_->Torque() == 0);
}

}  // namespace plumb
