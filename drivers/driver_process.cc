#include "drivers/driver_process.h"

#include <spdlog/spdlog.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <exception>
#include <span>

#include "common/driver_state_name.h"
#include "common/lcm_url.h"
#include "common/time_units.h"

namespace plumb {
namespace {

constexpr int64_t kStatusPeriod = 100'000;  // [us]
constexpr int64_t kReopenPeriod = 100'000;  // [us]
// of frames per wake: a flood must not keep us from our deadlines
constexpr int kBursts = 8;
constexpr int64_t kFlight = int64_t{kFlightSeconds} * 1'000'000;  // [us]

void WriteState(int8_t state, std::string_view reason) {
  const auto level = state == driver_status_t::FAULT ? spdlog::level::warn : spdlog::level::info;
  spdlog::log(level, "{}{}{}", DriverStateName(state), reason.empty() ? "" : ": ", reason);
}

void WriteLostStates(int64_t changes) {
  spdlog::warn("{} changes of state before these are missing here: nobody read them", changes);
}

void LogCommandPolicy(const std::string& lcm_url, bool commands_signed) {
  if (commands_signed) return spdlog::info("takes signed commands only");
  if (!StaysOnMachine(lcm_url))
    return spdlog::warn("takes unsigned commands of anybody on the network");
}

}  // namespace

DriverProcess::DriverProcess(Process& process, const RobotDescription& robot,
                             const std::string& flight_recorder, bool is_virtual)
    : process_(process),
      clock_(process.clock()),
      driver_(robot, clock_.Now(), clock_.Utime()),
      buses_(OpenBuses(process, robot, driver_, flight_recorder)),
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
      log_(STDERR_FILENO, WriteState, WriteLostStates),
      disarm_patience_(Microseconds(DisarmPatience(robot.driver) * std::max(1.0, clock_.scale()))) {
  for (const RobotBus& bus : buses_) fds_.push_back(bus.transport->fd());
  accepted_.resize(buses_.size());
  stats_.resize(buses_.size());
  driver_.set_virtual(is_virtual);
  const bool commands_signed = !process.key_file().empty();
  driver_.set_commands_signed(commands_signed);
  LogCommandPolicy(process.lcm_url(), commands_signed);
  process.messenger().Lead(robot.name, InOneLine(robot.buses));
  driver_.set_replay(
      std::ranges::any_of(buses_, [](const RobotBus& bus) { return bus.transport->is_replay(); }));
  for (const RobotBus& bus : buses_) {
    for (const std::string& warning : bus.transport->warnings()) spdlog::warn("{}", warning);
  }
  spdlog::info("{} on {}: {} joint{}, cycle {} us", robot.name, InOneLine(robot.buses),
               robot.num_joints(), robot.num_joints() == 1 ? "" : "s", driver_.cycle());
}

int DriverProcess::Run() {
  try {
    while (!process_.stopping()) Step();
    return DisarmAndStop("it was told to");
  } catch (const std::exception& error) {  // whatever it is, the motors come first
    deaf_ = true;
    try {
      DisarmAndStop(error.what());
    } catch (const std::exception&) {  // the first one says why
    }
    throw;
  }
}

void DriverProcess::Step() {
  const int64_t now = clock_.Now();
  int64_t next = Transport::kNever;
  for (const RobotBus& bus : buses_) next = std::min(next, bus.transport->NextEvent());
  process_.Doze(std::min(cycle_.Remaining(now), std::max(next, now) - now), fds_);
  process_.stopping();  // reads the second signal, too: while one waits, ppoll does not
  // A wake-up with nothing to do is not timed.
  phases_.Mark();
  if (ReceiveFrames()) phases_.End(PhaseTimes::kReceive);
  if (!deaf_ && Publish()) phases_.End(PhaseTimes::kPublish);
  phases_.Mark();
  if (!deaf_ && process_.messenger().Drain() > 0) phases_.End(PhaseTimes::kCommand);
  if (cycle_.Due(clock_.Now())) {
    Cycle();
  } else {
    log_.Drain();
  }
}

void DriverProcess::OnCommand(const joint_command_t& command) {
  driver_.OnCommand(command, clock_.Now(), clock_.Utime());
}

void DriverProcess::OnRequest(const driver_request_t& request) {
  driver_.OnRequest(request, clock_.Now(), clock_.Utime());
}

void DriverProcess::OnForgedRequest(const driver_request_t& request, std::string_view why) {
  // Stopping must never need a key.
  if (request.request == driver_request_t::DISARM || request.request == driver_request_t::ESTOP)
    return OnRequest(request);
  driver_.OnForgedArm(why);
}

bool DriverProcess::ReceiveFrames() {
  bool any = false;
  for (size_t i = 0; i < buses_.size(); ++i) any = ReceiveFrames(i) || any;
  return any;
}

bool DriverProcess::ReceiveFrames(size_t index) {
  RobotBus& bus = buses_[index];
  bool any = false;
  bus.transport->SetTime(clock_.Now());
  for (int burst = 0; burst < kBursts; ++burst) {
    const int count = bus.transport->Receive(received_);
    if (count <= 0) break;
    any = true;
    const int64_t now = clock_.Now();
    for (const Frame& frame : std::span(received_).first(static_cast<size_t>(count))) {
      const int64_t utime =
          frame.receive_ns != 0 ? clock_.UtimeFromRealtimeNs(frame.receive_ns) : clock_.Utime();
      bus.recorder.Record(frame, false, utime);
      driver_.OnFrame(index, frame, now, utime);
    }
  }
  driver_.OnLink(index, bus.transport->link());
  return any;
}

bool DriverProcess::Publish() {
  bool any = false;
  while (const joint_state_t* state = driver_.NextState()) any = states_.Publish(*state) || any;
  while (const imu_t* imu = driver_.NextImu()) any = imus_.Publish(*imu) || any;
  return any;
}

void DriverProcess::Cycle() {
  const int64_t now = clock_.Now();
  const int64_t lateness = cycle_.Advance(now);
  phases_.Mark();
  driver_.Tick(now, clock_.Utime(), lateness);
  phases_.End(PhaseTimes::kControl);
  for (size_t i = 0; i < buses_.size(); ++i) {
    const std::span<const Frame> frames = driver_.frames(i);
    buses_[i].transport->SetTime(now);
    accepted_[i] = frames.empty() ? 0 : buses_[i].transport->Send(frames);
  }
  phases_.End(PhaseTimes::kSend);
  const int64_t sent = clock_.Utime();
  driver_.Transmitted(accepted_, sent);
  for (size_t i = 0; i < buses_.size(); ++i) {
    FlightRecorder& recorder = buses_[i].recorder;
    const auto accepted = static_cast<size_t>(std::max(accepted_[i], 0));
    for (const Frame& frame : driver_.frames(i).first(accepted)) recorder.Record(frame, true, sent);
    // Again in the next cycle, where the last one is still being written.
    int64_t& dumped = buses_[i].faults_dumped;
    if (dumped != driver_.faults() && recorder.Dump(sent - kFlight, sent, driver_.reason()))
      dumped = driver_.faults();
  }
  if (now >= next_reopen_) Reopen(now);
  if (driver_.revision() == revision_ && now < next_status_) return;
  PublishStatus();
  revision_ = driver_.revision();
  next_status_ = now + kStatusPeriod;
}

void DriverProcess::Reopen(int64_t now) {
  for (size_t i = 0; i < buses_.size(); ++i) {
    if (buses_[i].transport->link() == LinkState::kUp) continue;
    next_reopen_ = now + kReopenPeriod;
    driver_.OnLink(i, buses_[i].transport->Reopen());
  }
}

void DriverProcess::PublishStatus() {
  for (size_t i = 0; i < buses_.size(); ++i) stats_[i] = buses_[i].transport->stats();
  driver_status_t& status =
      driver_.Status(clock_.Utime(), stats_, commands_.rejected() + requests_.rejected());
  phases_.Fill(status);
  statuses_.Publish(status);
  log_.Note(status.state, status.reason);
}

int DriverProcess::DisarmAndStop(std::string_view why) {
  driver_.End(why, clock_.Now(), clock_.Utime());
  const int64_t begin = clock_.Now();
  do {
    try {
      Step();
    } catch (const std::exception&) {
      // After the first one drives are still to confirm. A run in virtual time that is over
      // stands still: no time passes.
      if (!deaf_ || clock_.is_virtual()) throw;
    }
  } while (!driver_.confirmed_idle() && clock_.Now() - begin < disarm_patience_);
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

}  // namespace plumb
