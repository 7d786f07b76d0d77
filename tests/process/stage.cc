#include "tests/process/stage.h"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <iterator>
#include <sstream>

#include "common/time_units.h"
#include "controller/policy.h"

namespace plumb {
std::string Read(const std::filesystem::path& file) {
  // Empty where it cannot be read, as of a process that ends meanwhile, whose file in /proc fails
  // while it is being read.
  std::ostringstream text;
  text << std::ifstream(file).rdbuf();
  return text.str();
}

bool AwaitReally(const std::function<bool()>& so) {
  for (int i = 0; i < 120'000; ++i) {  // 20 minutes: whoever is as late as that hangs
    if (so()) return true;
    usleep(10'000);
  }
  return so();
}

std::string Stage::Environment(const char* name, const std::string& fallback) {
  const char* value = std::getenv(name);
  return value && *value ? value : fallback;
}

std::string Stage::Binary(const std::string& name) {
  return Environment("PLUMBLINE_BUILD", "build") + "/bin/" + name;
}

// Ports below 32768: from there on the kernel gives them to anybody who asks for none.
Stage::Stage(int number, const std::string& robot_file, Time time)
    : lcm_url("udpm://239.255.76.67:" + std::to_string(17700 + number) +
              "?ttl=0&recv_buf_size=2097152"),
      bus_url(
          Environment("PLUMBLINE_TEST_BUS", "udp:239.74.163.2:" + std::to_string(23200 + number))),
      robot_folder(Environment("PLUMBLINE_SOURCE", ".") + "/robots/" + robot_file),
      robot(LoadRobot(robot_folder)),
      folder(temporary_.path()),
      coordinator(time == Time::kVirtual
                      ? std::optional<Coordinator>(std::in_place, (folder / "clock").string())
                      : std::nullopt),
      clock(coordinator ? Clock(coordinator->participant().time()) : Clock()),
      messenger(coordinator ? Messenger(coordinator->participant()) : Messenger(lcm_url)),
      bus(OpenTransport(bus_url, {}, {coordinator ? &coordinator->participant() : nullptr, 0})),
      drivers(messenger, "DRIVER_STATUS"),
      controllers(messenger, "CONTROLLER_STATUS"),
      commands(messenger, "JOINT_COMMAND",
               [this](const joint_command_t& command) {
                 last_command = Now();
                 last_command_made = command.utime;
               }),
      states(messenger, "ROBOT_STATE", [this](const robot_state_t&) { last_state = Now(); }),
      requests_(messenger, "DRIVER_REQUEST"),
      policies_(messenger, "POLICY") {
  if (coordinator) coordinator->on_note = [this](const std::string& line) { notes += line + "\n"; };
}

Stage::~Stage() { children.clear(); }

Child& Stage::Start(const std::string& name, std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), {Binary(name), robot_folder, "--lcm-url", lcm_url, "--parent",
                                       std::to_string(getpid())});
  if (coordinator) arguments.insert(arguments.end(), {"--clock", coordinator->clock()});
  arguments.insert(arguments.end(), key_arguments_.begin(), key_arguments_.end());
  if (children.contains(name)) Kill(name);
  children.erase(name);
  Child& child =
      *children.emplace(name, std::make_unique<Child>(name, arguments, folder / (name + ".log")))
           .first->second;
  if (coordinator) coordinator->Expect(name, child.pid());
  return child;
}

void Stage::StartDriver() {
  std::vector<std::string> arguments{"--bus", bus_url, "--virtual", "--flight-recorder",
                                     folder / "faults"};
  Start("plumb-driver", arguments);
}

void Stage::StartRobotAndDriver() {
  Start("plumb-robot", {"--bus", bus_url, "--seed", "1"});
  StartDriver();
}

void Stage::StartAll() {
  StartRobotAndDriver();
  Start("plumb-estimator");
  Start("plumb-controller");
}

void Stage::Kill(const std::string& name) {
  children.at(name)->Signal(SIGKILL);
  REQUIRE(children.at(name)->WaitFor(60));
  if (coordinator) coordinator->AwaitEnd(name);
}

void Stage::Stall(const std::string& name, double seconds) {
  coordinator->Stall(name, Microseconds(seconds));
}

std::filesystem::path Stage::UseKey() {
  const std::filesystem::path file = folder / "key";
  MakeKeyFile(file);
  key_arguments_ = {"--key", file};
  messenger.Become(Identity("stage", SigningKey(file), clock,
                            coordinator ? Identity::Reach::kRun : Identity::Reach::kMachine, 0));
  return file;
}

bool Stage::WaitUntil(const std::function<bool()>& so, double seconds) {
  const int64_t deadline = clock.Now() + Microseconds(seconds);
  for (;;) {
    if (coordinator) {
      coordinator->participant().Wait(deadline, Participant::Wake::kWhenHeard);
    } else {
      messenger.Await(2);
    }
    messenger.Drain();
    Witness();
    if (so()) return true;
    if (clock.Now() >= deadline) return false;
  }
}

bool Stage::WaitForDriver(int8_t state, double seconds) {
  return WaitUntil([&] { return drivers.received() > 0 && drivers.newest().state == state; },
                   seconds);
}

void Stage::Request(int8_t what) {
  driver_request_t request{};
  request.utime = Now();
  request.request = what;
  requests_.Publish(request);
}

bool Stage::Arm(double seconds) {
  int64_t asked = 0;
  return WaitUntil(
      [&] {
        if (drivers.received() == 0) return false;
        const int8_t state = drivers.newest().state;
        if (state == driver_status_t::ARMED) return true;
        if (state != driver_status_t::ABSENT && state != driver_status_t::ARMING &&
            Now() - asked > 500'000) {
          Request(driver_request_t::ARM);
          asked = Now();
        }
        return false;
      },
      seconds);
}

void Stage::PublishPolicy(int iteration) {
  GaussianPolicy policy(PolicyShape{3, {4}, 1});
  policy.parameters(policy.parameters.size() - 2) = 0.5f;
  policy.action_scale.setConstant(static_cast<float>(robot.joints[0].effort_limit));
  policy_t message = policy.ToMessage();
  message.utime = Now();
  message.iteration = iteration;
  message.purpose = policy_t::EVALUATE;
  message.episodes = 1000;
  policies_.Publish(message);
}

bool Stage::BeginEpisode() {
  torque = 0;
  if (!Arm()) return false;
  PublishPolicy();
  if (!WaitUntil([&] { return torque != 0; }, 5)) return false;
  Listen(0.3);
  return torque != 0;
}

void Stage::RunWithTorque() {
  StartAll();
  REQUIRE(WaitUntil([&] { return controllers.received() > 0; }, 20));
  const bool moving = BeginEpisode();
  INFO("driver: " << int{drivers.newest().state} << " " << drivers.newest().reason
                  << "; controller: " << int{controllers.newest().phase} << " "
                  << controllers.newest().reason);
  REQUIRE(moving);
}

void Stage::Hear(const std::string& url, std::function<void(const Frame&)> frame) {
  ears_.push_back({OpenTransport(url, {}, {coordinator ? &coordinator->participant() : nullptr, 0}),
                   std::move(frame)});
}

void Stage::Witness() {
  for (const Ear& ear : ears_) {
    std::array<Frame, 64> heard;
    for (int n; (n = ear.bus->Receive(heard)) > 0;)
      std::ranges::for_each(std::span(heard).first(static_cast<size_t>(n)), ear.on_frame);
  }
  // Independent of the driver's own tables: node 1's Set_Input_Torque is 0x02E, its Heartbeat
  // 0x021.
  std::array<Frame, 64> frames_now;
  for (int n; (n = bus->Receive(frames_now)) > 0;) {
    for (const Frame& frame : std::span(frames_now).first(static_cast<size_t>(n))) {
      on_frame(frame);
      ++frames;
      if (frame.remote || frame.error) continue;
      ++frames_by_id[frame.id];
      if (frame.extended) continue;
      if (frame.id == 0x02E && frame.length >= 4) {
        std::memcpy(&torque, frame.data.data(), 4);
        if (torque == 0) continue;
        last_torque_time = frame.receive_ns / 1000;
        longest_alone = std::max(longest_alone, last_torque_time - last_command_made);
      } else if (frame.id == 0x021 && frame.length == 8) {
        axis_state = frame.data[4];
      }
    }
  }
}

}  // namespace plumb
