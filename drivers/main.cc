#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <unistd.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <array>
#include <stdexcept>

#include "common/examples.h"
#include "common/lcm_url.h"
#include "common/messenger.h"
#include "common/process.h"
#include "common/realtime.h"
#include "common/time_units.h"
#include "drivers/driver/driver.h"
#include "drivers/driver/flight_recorder.h"
#include "drivers/driver/phase_times.h"
#include "drivers/driver/state_log.h"
#include "robot/description.h"

namespace plumb {
namespace {

constexpr int64_t kStatusPeriod = 100'000;  // [us]
constexpr int64_t kReopenPeriod = 100'000;  // [us]
// [s] real time that the drives have to confirm a disarm at the end
constexpr double kDisarmTimeout = 0.3;
// of frames per wake: a flood must not keep us from our deadlines
constexpr int kBursts = 8;
constexpr int64_t kFlight = 2'000'000;    // [us] before a fault whose frames are kept
constexpr size_t kFlightFrames = 40'000;  // more than two buses of 1 Mbit/s carry in that time

void WriteState(int8_t state, std::string_view reason) {
  constexpr std::array names = {"ABSENT", "IDLE", "ARMING", "ARMED", "FAULT"};
  const auto level = state == driver_status_t::FAULT ? spdlog::level::warn : spdlog::level::info;
  spdlog::log(level, "{}{}{}", names[static_cast<size_t>(state)], reason.empty() ? "" : ": ",
              reason);
}

void LogCommandPolicy(const std::string& lcm_url, bool commands_signed) {
  if (commands_signed) return spdlog::info("takes signed commands only");
  if (!StaysOnMachine(lcm_url))
    return spdlog::warn("takes unsigned commands of anybody on the network");
}

class DriverProcess {
 public:
  DriverProcess(Process& process, const RobotDescription& robot, const std::string& bus,
                const std::string& flight_recorder, bool is_virtual)
      : process_(process),
        clock_(process.clock()),
        driver_(robot, clock_.Now(), clock_.Utime()),
        transport_(OpenTransport(bus, driver_.filters(),
                                 {process.participant(), Microseconds(robot.driver.effort_delay)})),
        cycle_(driver_.cycle(), clock_.Now()),
        states_(process.messenger(), "JOINT_STATE"),
        imus_(process.messenger(), "IMU"),
        statuses_(process.messenger(), "DRIVER_STATUS"),
        commands_(
            process.messenger(), "JOINT_COMMAND",
            [this](const joint_command_t& command) { OnCommand(command); }, Speakers::kOne,
            [this](const joint_command_t&, std::string_view why) { driver_.OnForgedCommand(why); }),
        requests_(
            process.messenger(), "DRIVER_REQUEST",
            [this](const driver_request_t& request) { OnRequest(request); }, Speakers::kSeveral,
            [this](const driver_request_t& request, std::string_view why) {
              OnForgedRequest(request, why);
            }),
        recorder_(flight_recorder, bus, kFlightFrames,
                  [](const std::string& file, const std::string& error) {
                    if (error.empty())
                      spdlog::warn("the frames of the last 2 s are in {}", file);
                    else
                      spdlog::error("the frames before the fault are lost: {}", error);
                  }) {
    if (robot.bus_data_bit_rate > 0 && !transport_->carries_fd()) {
      throw std::runtime_error(fmt::format(
          "{}: the interface is not set up for CAN FD, which {} needs; cure: ip link set CAN type "
          "can bitrate {:.0f} dbitrate {:.0f} fd on, or of a vcan: mtu 72",
          bus, robot.name, robot.bus_bit_rate, robot.bus_data_bit_rate));
    }
    driver_.set_bus(bus);
    driver_.set_virtual(is_virtual);
    const bool commands_signed = !process.key_file().empty();
    driver_.set_commands_signed(commands_signed);
    LogCommandPolicy(process.lcm_url(), commands_signed);
    process.messenger().Lead(robot.name, bus);
    driver_.set_replay(transport_->is_replay());
    for (const std::string& warning : transport_->warnings()) spdlog::warn("{}", warning);
    spdlog::info("{} on {}: {} joint{}, cycle {} us", robot.name, bus, robot.num_joints(),
                 robot.num_joints() == 1 ? "" : "s", driver_.cycle());
  }

  int Run() {
    try {
      while (!process_.stopping()) Step();
    } catch (const std::exception&) {  // whatever it is, the motors come first
      deaf_ = true;
      DisarmAndStop();
      throw;
    }
    return DisarmAndStop();
  }

 private:
  /// Waits for input or the cycle's deadline, and deals with what there is.
  void Step() {
    const int64_t now = clock_.Now();
    const int64_t next = std::max(transport_->NextEvent(), now) - now;
    process_.Doze(std::min(cycle_.Remaining(now), next), transport_->fd());
    process_.stopping();  // reads the second signal, too: while one waits, ppoll does not
    // A wake-up with nothing to do is not timed.
    phases_.Mark();
    if (ReceiveFrames()) phases_.End(PhaseTimes::kReceive);
    if (Publish()) phases_.End(PhaseTimes::kPublish);
    phases_.Mark();
    if (!deaf_ && process_.messenger().Drain() > 0) phases_.End(PhaseTimes::kCommand);
    if (cycle_.Due(clock_.Now())) {
      Cycle();
    } else {
      log_.Drain();
    }
  }

  void OnCommand(const joint_command_t& command) {
    driver_.OnCommand(command, clock_.Now(), clock_.Utime());
  }

  void OnRequest(const driver_request_t& request) {
    driver_.OnRequest(request, clock_.Now(), clock_.Utime());
  }

  void OnForgedRequest(const driver_request_t& request, std::string_view why) {
    // Stopping must never need a key.
    if (request.request == driver_request_t::DISARM || request.request == driver_request_t::ESTOP)
      return OnRequest(request);
    driver_.OnForgedArm(why);
  }

  /// @return whether there were any.
  bool ReceiveFrames() {
    bool any = false;
    transport_->SetTime(clock_.Now());
    for (int burst = 0; burst < kBursts; ++burst) {
      const int count = transport_->Receive(received_);
      if (count <= 0) break;
      any = true;
      const int64_t now = clock_.Now();
      for (const Frame& frame : std::span(received_).first(static_cast<size_t>(count))) {
        const int64_t utime =
            frame.receive_ns != 0 ? clock_.UtimeFromRealtimeNs(frame.receive_ns) : clock_.Utime();
        recorder_.Record(frame, false, utime);
        driver_.OnFrame(frame, now, utime);
      }
    }
    driver_.OnLink(transport_->link());
    return any;
  }

  /// @return whether there was anything to say.
  bool Publish() {
    bool any = false;
    while (const joint_state_t* state = driver_.NextState()) any = states_.Publish(*state) || any;
    while (const imu_t* imu = driver_.NextImu()) any = imus_.Publish(*imu) || any;
    return any;
  }

  void Cycle() {
    const int64_t now = clock_.Now();
    const int64_t lateness = cycle_.Advance(now);
    phases_.Mark();
    const std::span<const Frame> frames = driver_.Tick(now, clock_.Utime(), lateness);
    phases_.End(PhaseTimes::kControl);
    transport_->SetTime(now);
    const int accepted = frames.empty() ? 0 : transport_->Send(frames);
    phases_.End(PhaseTimes::kSend);
    const int64_t sent = clock_.Utime();
    driver_.Transmitted(accepted, sent);
    for (const Frame& frame : frames.first(static_cast<size_t>(std::max(accepted, 0))))
      recorder_.Record(frame, true, sent);
    const bool fault = driver_.state() == DriveState::kFault;
    if (fault && !faulty_) recorder_.Dump(sent - kFlight, sent, driver_.reason());
    faulty_ = fault;

    if (transport_->link() != LinkState::kUp && now >= next_reopen_) {
      next_reopen_ = now + kReopenPeriod;
      driver_.OnLink(transport_->Reopen());
    }
    if (driver_.revision() == revision_ && now < next_status_) return;
    PublishStatus();
    revision_ = driver_.revision();
    next_status_ = now + kStatusPeriod;
  }

  void PublishStatus() {
    driver_status_t& status = driver_.Status(clock_.Utime(), transport_->stats(),
                                             commands_.rejected() + requests_.rejected());
    phases_.Fill(status);
    statuses_.Publish(status);
    log_.Note(status.state, status.reason);
  }

  /// Zero torque and idle drives, confirmed by their heartbeats. @return 1 if a drive that may be
  /// armed has not confirmed it in time, else 0: one that was never there has nothing to confirm.
  int DisarmAndStop() {
    driver_request_t disarm{};
    disarm.utime = clock_.Utime();
    disarm.request = driver_request_t::DISARM;
    driver_.OnRequest(disarm, clock_.Now(), disarm.utime);
    const auto patience = Microseconds(kDisarmTimeout * clock_.scale());
    const int64_t begin = clock_.Now();
    do {
      Step();
    } while (!driver_.confirmed_idle() && clock_.Now() - begin < patience);
    PublishStatus();  // the last word: nothing is sent after it
    log_.Drain();
    const bool idle = driver_.confirmed_idle();
    if (!log_.ready()) return idle ? 0 : 1;
    if (!idle) {
      spdlog::error(
          "stopped, but a drive that was armed has not confirmed that it is idle; cure: cut its "
          "power");
    } else if (driver_.state() == DriveState::kAbsent) {
      spdlog::info("stopped; a drive is absent");
    } else {
      spdlog::info("stopped, drives idle");
    }
    return idle ? 0 : 1;
  }

  Process& process_;
  const Clock& clock_;
  Driver driver_;
  std::unique_ptr<Transport> transport_;
  Periodic cycle_;
  Publisher<joint_state_t> states_;
  Publisher<imu_t> imus_;
  Publisher<driver_status_t> statuses_;
  Subscriber<joint_command_t> commands_;
  Subscriber<driver_request_t> requests_;
  std::array<Frame, 64> received_;
  FlightRecorder recorder_;
  PhaseTimes phases_{!clock_.is_virtual()};
  bool faulty_ = false;
  bool deaf_ = false;  // whom to believe on LCM cannot be told any more
  int64_t next_reopen_ = 0;
  int64_t next_status_ = 0;
  uint64_t revision_ = 0;
  StateLog log_{STDERR_FILENO, WriteState};
};

}  // namespace
}  // namespace plumb

int main(int argc, char** argv) {
  std::string robot_path, bus, flight_recorder;
  bool allow_unsigned = false;
  int priority = 0;
  bool is_virtual = false;
  return plumb::Run(
      "plumb-driver", "Drives a robot's motors on a CAN bus: JOINT_COMMAND in, JOINT_STATE out.",
      argc, argv,
      [&](CLI::App& app) {
        app.add_option("robot", robot_path, "robot folder, or its TOML file")->required();
        app.add_option("--bus", bus,
                       "socketcan:can0, udp:239.74.163.2:43113; default: as the robot says");
        app.add_option("--flight-recorder", flight_recorder,
                       "folder: on every fault the frames of the last 2 s are written there");
        app.add_flag("--virtual", is_virtual,
                     "the robot is plumb-robot: while no effort is sent, its positions may jump");
        app.add_flag("--unsigned", allow_unsigned, "obey anybody, although LCM leaves this machine")
            ->excludes(app.get_option("--key"));
        plumb::AddRealtimeFlag(app, priority);
        plumb::AddExamples(app, {"plumb-driver robots/hopper --bus socketcan:can0 "
                                 "--realtime-priority 80 --key robot.key"});
      },
      [&](plumb::Process& process) {
        const plumb::RobotDescription robot = plumb::LoadRobot(robot_path);
        plumb::RequireKey(process.lcm_url(), !process.key_file().empty(), allow_unsigned);
        // LCM's thread comes right behind the cycle: what it brings is part of it.
        process.BecomeFast(std::max(priority - 1, 0));
        plumb::DriverProcess driver(process, robot, bus.empty() ? robot.bus_url : bus,
                                    flight_recorder, is_virtual);
        process.BecomeFast(priority);
        return driver.Run();
      });
}
