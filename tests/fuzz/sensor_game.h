#pragma once

#include <memory>
#include <vector>

#include "drivers/protocols/sensor.h"
#include "tests/fuzz/bytes.h"

namespace plumb {

/// A protocol's virtual sensor with what it measures, for SensorGame.
class VirtualSensor {
 public:
  virtual ~VirtualSensor() = default;

  /// Ids of the frames that concern host and sensor.
  virtual std::vector<uint32_t> ids() const = 0;
  virtual void OnFrame(const Frame& frame, int64_t now) = 0;
  virtual void Tick(int64_t now, FrameBatch& out) = 0;
  virtual int64_t NextDue() const = 0;
  virtual int64_t rejected() const = 0;

  /// Power lost, an error: what sensors do by themselves.
  virtual void Surprise(Bytes& bytes, int64_t now) = 0;
  /// @param sane whether what it measures may only do what it can do, else it may be anything.
  virtual void Move(Bytes& bytes, bool sane) = 0;
  virtual void Turn(int64_t microseconds) = 0;
  virtual void Heal() = 0;
  /// Of a reading on a clean wire: it is of now.
  virtual bool Agrees(const Sensor& host) const = 0;
};

/// As MotorGame, for a sensor. The input's first byte: bit 0 = the wire is clean and nobody else
/// speaks.
class SensorGame {
 public:
  static constexpr int64_t kStart = 1'000'000;

  SensorGame(std::unique_ptr<Sensor> host, std::unique_ptr<VirtualSensor> sensor, Bytes& bytes);
  void Play();

 private:
  void Operate();
  void Cycle(int64_t dt);
  void TellHost(const Frame& frame);
  void CheckHost();
  void StartAnew();

  Bytes& bytes_;
  std::unique_ptr<Sensor> host_;
  std::unique_ptr<VirtualSensor> sensor_;
  const std::vector<uint32_t> ids_;
  const std::vector<Filter> filters_;
  const bool clean_;
  bool surprised_ = false;
  BadWire wire_;
  FrameBatch said_, told_;  // in this cycle, by the sensor, by the host
  int64_t now_ = kStart;
  int64_t readings_ = 0;
  size_t accepted_ = FrameBatch::kCapacity;
};

}  // namespace plumb
