// No allocation in the driver's cycle, whatever happens in it. This binary counts what operator new
// is asked for.

#include <unistd.h>

#include <atomic>
#include <catch2/catch.hpp>
#include <cstdlib>
#include <fstream>
#include <new>
#include <vector>

#include "common/identity.h"
#include "drivers/can/transport.h"
#include "tests/drivers/driver/rig.h"
#include "tests/temporary_folder.h"

namespace {
std::atomic<long> allocations = 0;
}

// GCC pairs the inlined malloc with delete and warns.
#pragma GCC diagnostic ignored "-Wmismatched-new-delete"
void* operator new(std::size_t size) {
  ++allocations;
  if (void* memory = std::malloc(size ? size : 1)) return memory;
  throw std::bad_alloc();
}
void* operator new[](std::size_t size) { return operator new(size); }
void* operator new(std::size_t size, const std::nothrow_t&) noexcept {
  ++allocations;
  return std::malloc(size ? size : 1);
}
void* operator new[](std::size_t size, const std::nothrow_t& tag) noexcept {
  return operator new(size, tag);
}
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete[](void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }
void operator delete[](void* memory, std::size_t) noexcept { std::free(memory); }

namespace plumb {
namespace {

TEST_CASE("a thousand cycles with commands, faults and re-arming allocate nothing") {
  Rig rig(3);
  rig.robot.driver.stuck_after = 0.4;
  rig.robot.driver.stop = DriverSettings::Stop::kRamp;
  rig.robot.driver.ramp = 0.1;
  rig.robot.joints[0].limits.effort_rate = 50;
  rig.Start();
  REQUIRE(rig.Arm(1));
  // The wire is a real transport, so that its Send and Receive are counted, too.
  const auto driver_end = OpenTransport("loop:allocation"),
             drive_end = OpenTransport("loop:allocation");
  joint_command_t command = rig.MakeCommand(1);
  driver_request_t arm{};
  arm.request = driver_request_t::ARM_HOMED;
  rig.Status();

  std::array<Frame, 64> frames;
  long counted = 0, states = 0, faults = 0, armed = 0;
  for (int cycle = 0; cycle < 1000; ++cycle) {
    rig.now += 5000;
    FrameBatch batch;
    // jumps
    for (CanSimpleDevice& drive : rig.drives)
      drive.Tick(rig.now, {cycle % 300 == 140 ? 5.0 : 0.0, 0}, batch);
    drive_end->Send(batch.frames());
    command.utime = arm.utime = rig.utime();
    ++command.sequence;
    command.effort[0] = cycle % 7 == 0 ? NAN : 0.5;
    Frame event =
        *FrameFromText(cycle % 200 == 50 ? "021#0000000101030000" : "20000040#0000000000000000");

    const long before = allocations;
    while (const int count = driver_end->Receive(frames)) {
      for (int i = 0; i < count; ++i)
        rig.driver->OnFrame(0, frames[static_cast<size_t>(i)], rig.now, rig.utime());
    }
    if (cycle % 100 == 50) rig.driver->OnFrame(0, event, rig.now, rig.utime());
    while (rig.driver->NextState()) ++states;
    rig.driver->OnLink(0, driver_end->link());
    rig.driver->OnCommand(command, rig.now, rig.utime());
    if (cycle % 100 == 80) rig.driver->OnRequest(arm, rig.now, rig.utime());
    rig.driver->Tick(rig.now, rig.utime(), 10);
    const int accepted = driver_end->Send(rig.driver->frames(0));
    rig.driver->Transmitted({&accepted, 1}, rig.utime());
    counted += allocations - before;

    faults += rig.driver->state() == DriveState::kFault;
    armed += rig.driver->state() == DriveState::kArmed;
    while (const int count = drive_end->Receive(frames)) {
      for (int i = 0; i < count; ++i) {
        for (CanSimpleDevice& drive : rig.drives)
          drive.OnFrame(frames[static_cast<size_t>(i)], rig.now);
      }
    }
  }
  CHECK(counted == 0);
  CHECK(states == 1000);
  CHECK(faults > 100);
  CHECK(armed > 300);
  // The counter does count.
  const long before = allocations;
  ::operator delete(::operator new(1));
  const long after = allocations;
  CHECK(after == before + 1);
}

TEST_CASE("a status whose texts are as long as before allocates nothing") {
  Rig rig(2);
  rig.robot.driver.telemetry = 0.1;
  rig.Start();
  REQUIRE(rig.Arm(1));
  rig.to_driver = [](Frame& frame) { return (frame.id & 0x1F) != 0x15; };  // Get_Temperature
  const auto says = [&](const std::string& of_joint, const std::string& in_all) {
    const long before = allocations;
    const driver_status_t& status = rig.Status();
    const long after = allocations;
    CHECK(status.joint_reason[0].find(of_joint) != std::string::npos);
    CHECK(status.reason.find(in_all) != std::string::npos);
    return after - before;
  };
  rig.Run(2000);
  says("no temperatures for 2", "");
  rig.Run(100);
  CHECK(says("no temperatures for 2", "") == 0);
  // Absent drives: the whole of it says which one.
  rig.to_driver = [](Frame&) { return false; };
  rig.commanding = false;
  rig.Run(1000);
  rig.Request(driver_request_t::DISARM);
  rig.Run(1000);
  says("", "pivot: ");
  rig.Run(100);
  CHECK(says("", "pivot: ") == 0);
}

TEST_CASE("judging signatures, and what comes of it, allocates nothing") {
  const TemporaryFolder folder;
  MakeKeyFile(folder / "key");
  const SigningKey key(folder / "key");
  Rig rig;
  rig.Start();
  REQUIRE(rig.Arm(1));
  const auto time = std::make_shared<VirtualTime>();
  time->now = Rig::kEpoch;
  Identity driver("driver", key, Clock(time), Identity::Reach::kRun, 0);
  Identity controller("controller", key, Clock(time), Identity::Reach::kRun, 0);
  driver.Lead("robot", "bus");
  controller.Join(driver.run(), "robot", "bus");
  ChannelJudge judge;
  joint_command_t command = rig.MakeCommand(1);
  const auto size = static_cast<size_t>(command.getEncodedSize());
  std::vector<uint8_t> encoding(size + kSealSize);
  long counted = 0, genuine = 0, forged = 0;
  for (int i = 1; i <= 1000; ++i) {
    time->now += 1;
    const long before = allocations;
    command.encode(encoding.data(), 0, static_cast<int>(size));
    controller.Seal("JOINT_COMMAND", encoding);
    if (i % 3 == 0) encoding.back() ^= 1;
    const std::string_view refusal = judge.Hear(driver, "JOINT_COMMAND", encoding).refusal;
    ++(refusal.empty() ? genuine : forged);
    if (!refusal.empty()) rig.driver->OnForgedCommand(refusal);
    if (!refusal.empty()) rig.driver->OnForgedArm(refusal);
    counted += allocations - before;
  }
  CHECK(counted == 0);
  CHECK(genuine == 667);
  CHECK(forged == 333);
}

TEST_CASE("an open transport allocates nothing, faults or not") {
  const TemporaryFolder folder;
  const std::string name = folder / "bus.log";
  std::ofstream(name) << "(1.0) can0 029#11\n(1.1) can0 029#R\n";
  std::array<Frame, 16> frames;
  const FrameBatch batch = [] {
    FrameBatch all;
    for (int i = 0; i < 20; ++i) all.Push(*FrameFromText("02E#0000C03F00000000"));
    return all;
  }();
  for (const std::string& url :
       {std::string("loop:open"), "udp:239.74.163.79:" + std::to_string(20'000 + getpid() % 12'000),
        "replay:" + name,
        std::string(
            "faulty:loss=0.1,duplicate=0.1,reorder=0.1,corrupt=0.1,delay=1ms,jitter=1ms,full=0.01,"
            "errors=0.1,busoff=0.0001:loop:open")}) {
    INFO(url);
    const auto one = OpenTransport(url), other = OpenTransport(url);
    const long before = allocations;
    for (int64_t now = 0; now < 1'000'000; now += 1000) {
      for (Transport* transport : {one.get(), other.get()}) {
        transport->SetTime(now);
        transport->Send(batch.frames());
        transport->Receive(frames);
        transport->Reopen();
      }
    }
    CHECK(allocations == before);
    CHECK(one->stats().sent > 1000);
  }
}

}  // namespace
}  // namespace plumb
