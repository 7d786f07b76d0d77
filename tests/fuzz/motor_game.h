#pragma once

#include <deque>
#include <memory>
#include <optional>
#include <vector>

#include "drivers/protocols/motor.h"
#include "tests/fuzz/bytes.h"

namespace plumb {

/// A protocol's virtual drive with its shaft, and what is peculiar to the protocol, for MotorGame.
class VirtualDrive {
 public:
  virtual ~VirtualDrive() = default;

  /// Ids of the frames that concern host and drive.
  virtual std::vector<uint32_t> ids() const = 0;
  virtual void OnFrame(const Frame& frame, int64_t now) = 0;
  virtual void Tick(int64_t now, FrameBatch& out) = 0;
  virtual int64_t NextDue() const = 0;
  virtual bool armed() const = 0;
  virtual double Torque() const = 0;
  virtual int64_t rejected() const = 0;

  /// Power lost, an error: what drives do by themselves.
  /// @param sane whether its readings stay numbers that can be.
  virtual void Surprise(Bytes& bytes, bool sane, int64_t now) = 0;
  /// Nothing is wrong with it any more.
  virtual void Heal() = 0;
  /// @param sane whether the shaft may only do what shafts can do, else its sample may be anything.
  virtual void Move(Bytes& bytes, bool sane) = 0;
  virtual void Turn(int64_t microseconds) = 0;

  /// [Nm] in a frame of Motor::Torque; nothing if it is not one.
  virtual std::optional<double> TorqueIn(const Frame& frame) const = 0;
  /// The most it may be.
  virtual double max_torque() const = 0;
  /// By how much it may differ from what was asked for.
  virtual double Rounding(double torque) const = 0;
  /// Whether its frames are of CAN FD, then with ids of 29 bits where 11 do not do.
  virtual bool fd() const { return false; }
  /// Whether Motor::Tick may give this frame.
  virtual bool MayBeTold(const Frame& frame, DriveState state) const = 0;
  /// Of a clean link: the host knows where the shaft is.
  virtual bool Agrees(const MotorEstimate& estimate) const = 0;
};

/// Plays what the input says between a protocol's host, a virtual drive, and a wire that may spoil
/// what it carries; requires at all times what must hold. The input's first byte: bit 0 = the wire
/// is clean and nobody else speaks, then more must hold; bits 1 and 2 = cycles that the drive's
/// frames take to the host.
class MotorGame {
 public:
  static constexpr int64_t kStart = 1'000'000;

  MotorGame(std::unique_ptr<Motor> motor, std::unique_ptr<VirtualDrive> drive, Bytes& bytes);
  void Play();

 private:
  void Operate();
  void Cycle(int64_t dt);
  void TellDrive(const Frame& frame);
  void TellHost(const Frame& frame);
  void SetTorque(double torque);
  void CheckHost();
  void CheckDrive();
  void ComeToRestAndArm();

  Bytes& bytes_;
  std::unique_ptr<Motor> motor_;
  std::unique_ptr<VirtualDrive> drive_;
  const std::vector<uint32_t> ids_;
  const bool clean_;
  size_t latency_;
  FrameBatch said_, told_;  // in this cycle, by the drive, by the host
  struct OnTheWay {
    Frame frame;
    size_t cycle;
  };
  std::deque<OnTheWay> on_the_way_;  // from the drive, with the cycle in which it arrives
  size_t cycle_ = 0;
  BadWire wire_;
  int64_t now_ = kStart;
  size_t accepted_ = FrameBatch::kCapacity;
  bool may_arm_ = true;
  double torque_ = 0;
};

}  // namespace plumb
