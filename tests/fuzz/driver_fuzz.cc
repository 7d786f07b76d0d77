// libFuzzer: the driver's state machine with two virtual ODrives and a boom encoder, a wire that
// may spoil what it carries, strangers, clocks that are set and people who ask for anything at any
// time. Whatever happens: no torque unless the robot is armed, the command and the measurements are
// fresh, and limits are kept; and once nothing is wrong any more it can be armed again.

#include <array>
#include <cmath>
#include <numbers>
#include <optional>
#include <span>
#include <vector>

#include "drivers/driver/driver.h"
#include "drivers/protocols/cansimple_device.h"
#include "drivers/protocols/cia406_device.h"
#include "tests/fuzz/bytes.h"
#include "tests/fuzz/leg.h"

namespace plumb {
namespace {

using namespace cansimple;

constexpr double kTurn = 2 * std::numbers::pi;
constexpr int64_t kStart = 1'000'000, kEpoch = 1'700'000'000'000'000;
constexpr size_t kMotors = 2;
constexpr int kSlide = 2;  // the passive joint

class DriverGame {
 public:
  explicit DriverGame(Bytes& bytes)
      : bytes_(bytes), robot_(Leg()), driver_(robot_, kStart, kEpoch + kStart) {
    for (int node = 1; node <= static_cast<int>(kMotors); ++node) {
      drives_.emplace_back(CanSimpleDevice::Settings{.node = node,
                                                     .heartbeat_period = 20'000,
                                                     .encoder_period = 5'000,
                                                     .watchdog = 50'000},
                           kStart);
    }
    boom_.emplace(Cia406Device::Settings{.event_timer = 5'000}, kStart);
    // As a rule the fuzzer begins with a robot that runs.
    if (bytes_.Byte() < 240) Require(Arm());
  }

  void Play() {
    while (!bytes_.empty()) Operate();
    ComeToRest();
    Require(Arm());
    Require(driver_.reason().empty());
  }

 private:
  void Operate() {
    switch (bytes_.Byte() % 16) {
      case 0:
      case 1:
      case 2:
        for (int n = bytes_.Byte() % 16; n >= 0; --n) Cycle();
        break;
      case 3:
        commanding_ = !commanding_;
        effort_ = bytes_.Modest(10);
        break;
      case 4:
        Command(true);
        break;
      case 5:
        Request();
        break;
      case 6: {
        Frame frame = bytes_.AnyFrame(kIds);
        frame.foreign = (bytes_.Byte() & 3) == 3;
        ToDriver(frame);
        break;
      }
      case 7:
        wire_.Spoil(bytes_);
        break;
      case 8:
        link_ = bytes_.Pick(std::array{LinkState::kUp, LinkState::kDown, LinkState::kGone});
        driver_.OnLink(0, link_);
        break;
      case 9:
        accepted_ = bytes_.Byte() % 16;
        if (accepted_ == 15) accepted_ = FrameBatch::kCapacity;
        break;
      case 10: {
        const size_t i = bytes_.Byte() % (kMotors + 1);
        position_[i] = bytes_.Modest(3);
        velocity_[i] = bytes_.Modest(30);
        break;
      }
      case 11:
        Surprise();
        break;
      case 12:
        now_ += bytes_.Pick(kSteps);
        break;
      case 13:
        ahead_ += bytes_.Modest(1e7);  // somebody sets the clock
        break;
      case 14:
        driver_.OnForgedCommand("it is not signed");
        driver_.OnForgedArm("it is not signed");
        break;
      case 15:
        driver_.set_virtual((bytes_.Byte() & 1) != 0);
        break;
    }
    CheckState();
    Require(driver_.Status(utime(), {}, 0).state == static_cast<int8_t>(driver_.state()));
  }

  int64_t utime() const { return kEpoch + now_ + ahead_; }

  void Cycle() {
    for (int i = 0; i < 5; ++i) {
      now_ += 1000;
      for (size_t k = 0; k < kMotors; ++k) position_[k] += 1e-3 * velocity_[k];
      Devices();
    }
    if (commanding_) Command(false);
    while (const joint_state_t* state = driver_.NextState()) {
      for (size_t i = 0; i < kMotors; ++i)
        Require(std::isfinite(state->position[i]) && std::isfinite(state->velocity[i]));
    }
    Tick();
    CheckState();
  }

  void Devices() {
    FrameBatch said;
    for (size_t i = 0; i < kMotors; ++i) {
      const JointMap map(robot_.joints[i].motor);
      drives_[i].Tick(
          now_, {map.MotorPosition(position_[i]) / kTurn, map.MotorVelocity(velocity_[i]) / kTurn},
          said);
    }
    boom_->Tick(now_, position_[kSlide], said);
    for (const Frame& frame : said.frames())
      wire_.Carry(frame, [this](const Frame& f) { ToDriver(f); });
  }

  void ToDriver(const Frame& frame) {
    for (size_t i = 0; i < kMotors; ++i) {
      const bool estimates = frame.id == ((i + 1) << 5 | kGetEncoderEstimates.command) &&
                             !frame.extended && !frame.remote && !frame.error && !frame.fd &&
                             !frame.foreign && frame.length >= 8;
      const auto values = estimates ? DecodePayload(kGetEncoderEstimates, frame) : std::nullopt;
      if (!values) continue;
      const JointMap map(robot_.joints[i].motor);
      measured_[i] = now_;
      q_[i] = map.JointPosition((*values)[0] * kTurn);
      v_[i] = map.JointVelocity((*values)[1] * kTurn);
    }
    driver_.OnFrame(0, frame, now_, utime());
  }

  void Tick() {
    driver_.Tick(now_, utime(), 0);
    const std::span<const Frame> frames = driver_.frames(0);
    for (const Frame& frame : frames) {
      Require(IsWellFormed(frame) && !frame.foreign && !frame.error && !frame.extended);
      for (size_t i = 0; i < kMotors; ++i) {
        if (frame.id != ((i + 1) << 5 | kSetInputTorque.command)) continue;
        float torque;
        std::memcpy(&torque, frame.data.data(), 4);
        CheckTorque(i, JointMap(robot_.joints[i].motor).JointEffort(torque));
      }
    }
    const size_t taken = std::min(accepted_, frames.size());
    driver_.Transmitted(std::array{static_cast<int>(taken)}, utime());
    for (size_t k = 0; k < taken; ++k) {
      wire_.Carry(frames[k], [this](const Frame& frame) {
        for (CanSimpleDevice& drive : drives_) drive.OnFrame(frame, now_);
        boom_->OnFrame(frame, now_);
      });
    }
  }

  /// The promises about torque: fresh commands only, an armed robot only, the limits kept.
  void CheckTorque(size_t i, double effort) const {
    Require(std::isfinite(effort));
    if (effort == 0) return;
    Require(may_run_);  // somebody has armed it, and nobody has stopped it since
    Require(driver_.state() == DriveState::kArmed);
    Require(link_ == LinkState::kUp);
    Require(now_ - commanded_ <= 20'000);
    for (const int64_t measured : measured_) Require(now_ - measured <= 20'000);
    const JointDescription& joint = robot_.joints[i];
    Require(std::abs(effort) <= joint.effort_limit * (1 + 1e-6));
    if (q_[i] > joint.upper || v_[i] > joint.velocity_limit) Require(effort < 0);
    if (q_[i] < joint.lower || v_[i] < -joint.velocity_limit) Require(effort > 0);
  }

  void CheckState() {
    const DriveState state = driver_.state();
    // Only an order to arm leads out of a fault.
    if (fault_ && !asked_to_arm_)
      Require(state == DriveState::kFault || state == DriveState::kIdle ||
              state == DriveState::kAbsent);
    if (state == DriveState::kFault) may_run_ = asked_to_arm_ = false;
    fault_ = state == DriveState::kFault;
    Require((state == DriveState::kArmed) == driver_.reason().empty());
  }

  void Command(bool anything) {
    joint_command_t command{};
    const size_t joints = anything && bytes_.Byte() == 0 ? bytes_.Byte() % 8 : robot_.joints.size();
    command.num_joints = static_cast<int32_t>(joints);
    command.sequence = ++sequence_;
    command.utime = utime();
    command.effort.assign(joints, effort_);
    for (auto* values : {&command.position, &command.velocity, &command.kp, &command.kd}) {
      values->assign(joints, std::numeric_limits<double>::quiet_NaN());
    }
    if (anything) {
      const uint8_t kind = bytes_.Byte();
      for (auto* values :
           {&command.effort, &command.position, &command.velocity, &command.kp, &command.kd}) {
        for (double& value : *values) value = (kind & 1) != 0 ? bytes_.Number() : bytes_.Modest(5);
      }
      if ((kind & 2) != 0) command.sequence = bytes_.Value<int64_t>();
      if ((kind & 4) != 0) command.utime = bytes_.Value<int64_t>();
      if ((kind & 8) != 0) command.expiry = bytes_.Value<int32_t>();
    }
    commanded_ = now_;
    driver_.OnCommand(command, now_, utime());
  }

  void Request() {
    driver_request_t request{};
    request.request = static_cast<int8_t>(bytes_.Byte() % 6);
    const uint8_t when = bytes_.Byte();
    request.utime = when < 192   ? utime()
                    : when < 224 ? utime() + static_cast<int64_t>(bytes_.Modest(3e6))
                                 : bytes_.Value<int64_t>();
    Ask(request);
  }

  void Ask(const driver_request_t& request) {
    driver_.OnRequest(request, now_, utime());
    if (request.request == driver_request_t::ARM || request.request == driver_request_t::ARM_HOMED)
      may_run_ = asked_to_arm_ = true;
    if (request.request == driver_request_t::DISARM || request.request == driver_request_t::ESTOP)
      may_run_ = asked_to_arm_ = false;
  }

  void Surprise() {
    const uint8_t what = bytes_.Byte();
    CanSimpleDevice& drive = drives_[what & 1];
    switch (what >> 1 & 7) {
      case 0:
        return drive.Reboot(now_);
      case 1:
        return drive.set_temperature(bytes_.Number());
      case 2:
        return drive.set_bus_voltage(bytes_.Number());
      case 3:
        return boom_->Reboot(now_);
      case 4:
        return boom_->Emergency(bytes_.Value<uint16_t>());
      case 5:
        wire_.Mend();
        return;
      default:
        accepted_ = FrameBatch::kCapacity;
    }
  }

  /// Nothing is wrong any more, and has not been for a while.
  void ComeToRest() {
    wire_.Mend();
    accepted_ = FrameBatch::kCapacity;
    driver_.OnLink(0, link_ = LinkState::kUp);
    ToDriver({.id = 0x100, .error = true, .length = 8});  // the controller has been restarted
    position_ = velocity_ = {};
    effort_ = 0;
    boom_->Emergency(0);
    for (CanSimpleDevice& drive : drives_) {
      drive.set_temperature(25);
      drive.set_bus_voltage(24);
    }
    ahead_ += 40'000'000'000;  // later than whatever was said
    commanding_ = false;
    for (int i = 0; i < 60; ++i) Cycle();
    sequence_ = 0;
  }

  /// A sensor or drive that failed takes a first attempt to begin anew, and a while.
  bool Arm() {
    for (int attempt = 0; attempt < 30 && driver_.state() != DriveState::kArmed; ++attempt) {
      commanding_ = false;  // a controller that talks on would be taken for one of an earlier run
      for (int i = 0; i < 12; ++i) Cycle();
      driver_request_t arm{};
      arm.utime = utime();
      arm.request = driver_request_t::ARM_HOMED;
      Ask(arm);
      commanding_ = true;
      for (int i = 0; i < 30 && driver_.state() != DriveState::kArmed; ++i) Cycle();
    }
    return driver_.state() == DriveState::kArmed;
  }

  static constexpr uint32_t kIds[] = {
      0x20, 0x21, 0x23, 0x26, 0x29, 0x2E, 0x34,  0x35, 0x37,  0x3C,  0x41,  0x43, 0x49, 0x4E,
      0x55, 0x57, 0x5C, 0x22, 0x42, 0x27, 0x7E2, 0x81, 0x181, 0x581, 0x701, 0x00, 0x40, 0x100};

  Bytes& bytes_;
  const RobotDescription robot_;
  Driver driver_;
  std::vector<CanSimpleDevice> drives_;
  std::optional<Cia406Device> boom_;
  BadWire wire_;
  int64_t now_ = kStart, ahead_ = 0;
  std::array<double, kMotors + 1> position_{}, velocity_{};
  LinkState link_ = LinkState::kUp;
  size_t accepted_ = FrameBatch::kCapacity;
  bool commanding_ = false;
  double effort_ = 0;
  int64_t sequence_ = 0;
  // The truth, as far as the driver can know it.
  std::array<int64_t, kMotors> measured_{};
  std::array<double, kMotors> q_{}, v_{};
  int64_t commanded_ = 0;
  bool may_run_ = false, asked_to_arm_ = false, fault_ = false;
};

}  // namespace
}  // namespace plumb

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  plumb::Bytes bytes({data, size});
  plumb::DriverGame(bytes).Play();
  return 0;
}
