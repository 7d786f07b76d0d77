#include "drivers/driver/command_inbox.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <limits>

#include "common/special_numbers.h"

namespace plumb {
namespace {

constexpr int64_t kUtime = 1'700'000'000'000'000;

joint_command_t Command(int64_t sequence, double effort, int joints = 2) {
  joint_command_t command{};
  const auto size = static_cast<size_t>(joints);
  command.utime = kUtime;
  command.sequence = sequence;
  command.num_joints = joints;
  command.expiry = 0;
  command.effort.assign(size, effort);
  for (auto* values : {&command.position, &command.velocity, &command.kp, &command.kd})
    values->assign(size, kNaN);
  return command;
}

TEST_CASE("the newest command counts") {
  CommandInbox inbox(2, 100'000);
  CHECK(inbox.empty());
  CHECK(inbox.Expired(0));
  REQUIRE(inbox.Offer(Command(5, 1), 1000, kUtime));
  REQUIRE(inbox.Offer(Command(7, 2), 2000, kUtime));
  CHECK_FALSE(inbox.Offer(Command(6, 3), 3000, kUtime));  // overtaken
  CHECK_FALSE(inbox.Offer(Command(7, 3), 3000, kUtime));  // twice
  CHECK(inbox.Effort(0, 0, 0) == 2);
  CHECK(inbox.arrival() == 2000);
  inbox.Clear();
  CHECK(inbox.empty());
  CHECK(inbox.Offer(Command(0, 4), 4000, kUtime));  // a controller that started anew
}

TEST_CASE("a sequence number that nobody has does not lock out the controller") {
  CommandInbox inbox(2, 100'000);
  constexpr int64_t kGreatest = std::numeric_limits<int64_t>::max();
  CHECK_FALSE(inbox.Offer(Command(kGreatest, 9), 0, kUtime));  // the first one
  CHECK_FALSE(inbox.Offer(Command(-1, 9), 0, kUtime));
  CHECK(inbox.empty());
  CHECK_FALSE(inbox.refusal().empty());
  REQUIRE(inbox.Offer(Command(7'000'000, 1), 1000, kUtime));
  CHECK(inbox.refusal().empty());
  CHECK_FALSE(inbox.Offer(Command(8'000'001, 9), 2000, kUtime));
  CHECK(inbox.refusal() == "their sequence jumps");
  CHECK_FALSE(inbox.Offer(Command(kGreatest, 9), 2000, kUtime));
  CHECK(inbox.Offer(Command(7'000'001, 2), 3000, kUtime));
  CHECK(inbox.Effort(0, 0, 0) == 2);
  CHECK(inbox.Offer(Command(8'000'001, 3), 3000, kUtime));  // a million were lost
}

TEST_CASE("what is no command") {
  CommandInbox inbox(2, 100'000);
  const auto rejects = [&](const joint_command_t& command) {
    return !inbox.Offer(command, 0, kUtime) && inbox.empty();
  };
  CHECK(rejects(Command(1, 0, 1)));
  CHECK(rejects(Command(1, kNaN)));
  CHECK(rejects(Command(1, INFINITY)));
  for (const auto member :
       {&joint_command_t::effort, &joint_command_t::position, &joint_command_t::velocity,
        &joint_command_t::kp, &joint_command_t::kd}) {
    joint_command_t command = Command(1, 0);
    (command.*member)[1] = -INFINITY;
    CHECK(rejects(command));
    (command.*member).pop_back();
    CHECK(rejects(command));
  }
  joint_command_t command = Command(1, 0);
  command.kp[0] = -1;
  CHECK(rejects(command));
  for (const int64_t utime :
       {kUtime - 100'001, kUtime + 100'001, std::numeric_limits<int64_t>::min(),
        std::numeric_limits<int64_t>::max()}) {
    command = Command(1, 0);
    command.utime = utime;
    CHECK(rejects(command));
  }
  command = Command(1, 0);
  command.expiry = -1;
  CHECK(rejects(command));
  CHECK_FALSE(rejects(Command(1, 0)));
}

TEST_CASE("a command expires, sooner if it wants to") {
  CommandInbox inbox(2, 100'000);
  inbox.Offer(Command(1, 1), 1000, kUtime);
  CHECK_FALSE(inbox.Expired(101'000));
  CHECK(inbox.Expired(101'001));
  joint_command_t brief = Command(2, 1);
  brief.expiry = 10'000;
  inbox.Offer(brief, 1000, kUtime);
  CHECK(inbox.Expired(11'001));
  joint_command_t immortal = Command(3, 1);
  immortal.expiry = std::numeric_limits<int64_t>::max();
  inbox.Offer(immortal, 1000, kUtime);
  CHECK(inbox.Expired(101'001));
}

TEST_CASE("a command that has waited lasts no longer for it") {
  CommandInbox inbox(2, 100'000);
  const int64_t waited = 90'000;
  REQUIRE(inbox.Offer(Command(1, 1), 1000, kUtime + waited));
  CHECK_FALSE(inbox.Expired(11'000));
  CHECK(inbox.Expired(11'001));
  joint_command_t brief = Command(2, 1);
  brief.expiry = 10'000;
  CHECK_FALSE(inbox.Offer(brief, 1000, kUtime + waited));
  CHECK(inbox.refusal() == "they were computed too long ago");
  // Its clock may be ahead of ours: its life begins when it is taken.
  REQUIRE(inbox.Offer(brief, 1000, kUtime - waited));
  CHECK(inbox.Expired(11'001));
}

TEST_CASE("gains pull towards their targets") {
  CommandInbox inbox(2, 100'000);
  joint_command_t command = Command(1, 0.5);
  command.kp[0] = 10;
  command.position[0] = 1;
  command.kd[0] = 2;
  command.velocity[0] = -1;
  command.kp[1] = 10;  // no target: no pull
  inbox.Offer(command, 0, kUtime);
  CHECK(inbox.Effort(0, 0.8, 3) == Approx(0.5 + 10 * 0.2 + 2 * -4));
  CHECK(inbox.Effort(1, 0.8, 3) == 0.5);
}

}  // namespace
}  // namespace plumb
