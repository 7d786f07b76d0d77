// Contact flags beside the simulator's own forces, on a hopper that falls and pushes off.

#include "estimator/ground_contact.h"

#include <catch2/catch.hpp>
#include <cmath>

#include "sim/simulator.h"
#include "tests/estimator/observer_errors.h"
#include "tests/sim/robots.h"

namespace plumb {
namespace {

/// Whether the ground pushes one of a robot's points: the simulator's next velocities are not those
/// of a robot without it.
class PushedPoint {
 public:
  PushedPoint(RobotDescription robot, size_t point)
      : with_(Only(robot, point)), without_(Only(robot, SIZE_MAX)) {}

  bool operator()(const Eigen::VectorXd& q, const Eigen::VectorXd& v) {
    constexpr double kShort = 1e-5;  // [s]
    for (Simulator* simulator : {&with_, &without_}) {
      simulator->SetState(q, v);
      simulator->Step(Eigen::VectorXd::Zero(v.size()), kShort);
    }
    return (with_.v() - without_.v()).norm() > 1e-12;
  }

 private:
  static RobotDescription Only(RobotDescription robot, size_t kept) {
    const std::vector<ContactPoint> points = ContactPoints(robot);
    for (LinkDescription& link : robot.links) link.collisions.clear();
    if (kept == SIZE_MAX) {
      robot.simulation.contact.reset();
      return robot;
    }
    Shape sphere;
    sphere.position = points[kept].centre;
    sphere.size[0] = points[kept].radius;
    robot.links[static_cast<size_t>(points[kept].link)].collisions.push_back(sphere);
    return robot;
  }

  Simulator with_, without_;
};

TEST_CASE("contact flags agree with the simulator's forces") {
  const RobotDescription robot = WithSimulatedNoise(LoadRobot(SourceFile("robots/hopper")));
  const size_t num_points = ContactPoints(robot).size();
  REQUIRE(num_points == 2);
  constexpr int64_t kAround = 6'000;  // [us] of a touchdown or lift-off that do not count
  int count = 0, agree = 0, far = 0, far_agree = 0, touchdowns = 0, latency = 0, slowest = 0;
  for (const auto& recording : Record(robot, 1, 4)) {
    StateObserver observer(robot);
    std::vector<robot_state_t> states;
    for (const SimulatedReadings::Sample& sample : recording) {
      for (const imu_t& imu : sample.imus) observer.OnImu(imu);
      observer.OnJointState(sample.joints);
      states.push_back(observer.state());
      REQUIRE(states.back().num_contacts == 2);
      if (!observer.state().valid) CHECK(observer.state().contact == std::vector<int8_t>{-1, -1});
    }
    for (size_t point = 0; point < num_points; ++point) {
      PushedPoint pushed(robot, point);
      std::vector<bool> truth;
      for (const SimulatedReadings::Sample& sample : recording)
        truth.push_back(pushed(sample.q, sample.v));
      for (size_t k = 10; k < truth.size(); ++k) {
        const bool right = (states[k].contact[point] == 1) == truth[k];
        ++count;
        agree += right;
        bool near = false;
        constexpr size_t kNear = kAround / SimulatedReadings::kPeriod;
        for (size_t other = k - kNear; other <= std::min(k + kNear, truth.size() - 1); ++other)
          near = near || truth[other] != truth[k];
        far += !near;
        far_agree += !near && right;
        if (!truth[k] || truth[k - 1]) continue;
        ++touchdowns;
        int cycles = 0;
        while (k + static_cast<size_t>(cycles) < truth.size() &&
               truth[k + static_cast<size_t>(cycles)] &&
               states[k + static_cast<size_t>(cycles)].contact[point] != 1) {
          ++cycles;
        }
        latency += cycles;
        slowest = std::max(slowest, cycles);
      }
    }
  }
  const double share = static_cast<double>(agree) / count,
               far_share = static_cast<double>(far_agree) / far;
  const double mean_latency = static_cast<double>(latency) / touchdowns;
  INFO(count << " flags, " << 100 * share << " % agree, " << 100 * far_share
             << " % away from changes; " << touchdowns << " touchdowns seen after " << mean_latency
             << " cycles, at most " << slowest);
  CHECK(touchdowns > 10);
  CHECK(share > 0.94);
  CHECK(far_share > 0.95);
  CHECK(mean_latency < 2);
  CHECK(slowest <= 5);
}

TEST_CASE("resting is judged by height and velocity, with hysteresis") {
  using Motion = ContactTest::Motion;
  ContactTest test;
  const auto rests = [&](double height, double rise, double height_sd = 0, double rise_sd = 0) {
    return test.Judge(
        Motion{.height = height, .height_sd = height_sd, .rise = rise, .rise_sd = rise_sd});
  };
  CHECK_FALSE(rests(0.05, 0));    // in the air
  CHECK_FALSE(rests(0.001, -2));  // about to land
  CHECK(rests(-0.005, -1.5));     // lands on what gives way
  CHECK(rests(-0.01, 0.1));
  CHECK_FALSE(rests(-0.01, 1));  // has pushed off
  CHECK_FALSE(rests(0.0025, 0));
  CHECK(rests(0.0015, 0));
  CHECK(rests(0.0025, 0));  // stays what it was
  // An uncertain height speaks neither for nor against: 2 cm is not far if it may as well be none.
  CHECK(rests(0.02, 0, 0.02));
  CHECK_FALSE(rests(0.02, 2, 0.02));
  CHECK(rests(0.02, 1.5, 0.02, 1.5));
  // What slides does not rest, unless nobody knows how fast it does.
  test.Restart();
  const auto slides = [&](double slide, double slide_sd) {
    return test.Judge(Motion{.height = 0,
                             .height_sd = 0,
                             .rise = 0,
                             .rise_sd = 0,
                             .slide = slide,
                             .slide_sd = slide_sd});
  };
  CHECK_FALSE(slides(2, 0.1));
  CHECK(slides(2, 3));
  CHECK(slides(0.3, 0.1));
}

TEST_CASE("a robot that does not touch the ground has no contacts") {
  CHECK(GroundContact(LoadPendulum("robot.toml")).num_points() == 0);
  RobotDescription robot = LoadRobot(SourceFile("robots/hopper"));
  robot.simulation.contact.reset();
  CHECK(GroundContact(robot).num_points() == 0);
}

}  // namespace
}  // namespace plumb
