#include "estimator/model/unscented_observer.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>

#include "common/decompositions.h"
#include "common/random.h"
#include "tests/sim/robots.h"

namespace plumb {
namespace {

constexpr double kMass = 2, kPeriod = 0.005, kAge = 0.0013, kTiming = 0.004;

/// A mass on a level slide without friction.
RobotDescription Slide() {
  RobotDescription robot = LoadPendulum("robot.toml");
  robot.parameters.clear();
  robot.virtual_robot.hidden.clear();
  robot.links[1].mass = kMass;
  robot.joints[0].type = JointDescription::Type::kPrismatic;
  robot.joints[0].axis = Eigen::Vector3d::UnitX();
  robot.joints[0].dynamics = {};
  robot.estimator = {.position_sd = 1e-3,
                     .velocity_sd = 0.05,
                     .jerk = 50,
                     .effort_step = 0,
                     .timing_sd = kTiming,
                     .lag = 10,
                     .reset_after = 0.5,
                     .delay = kAge,
                     .model_acceleration = 0.2};
  return robot;
}

joint_state_t Measured(int64_t k, double position, double velocity, double effort) {
  joint_state_t m{};
  m.utime = 1'000'000 + 5000 * k;
  m.sequence = k;
  m.num_joints = 1;
  m.measured = {m.utime};
  m.position = {position};
  m.velocity = {velocity};
  m.effort_measured = m.effort_sent = {0.0};
  m.effort_applied = {effort};
  m.valid = {1};
  return m;
}

robot_state_t Kinematic(const joint_state_t& measured, double q = 0.1, double v = 0.3) {
  robot_state_t s{};
  s.utime = measured.utime;
  s.sequence = measured.sequence;
  s.num_positions = s.num_velocities = 1;
  s.q = {q};
  s.v = {v};
  s.q_sd = {1e-3};
  s.v_sd = {0.1};
  s.effort = measured.effort_applied;
  s.valid = true;
  return s;
}

// Independent truth: Kalman's equations for v' = u / m, in closed form.
TEST_CASE("of a linear robot it is the Kalman filter") {
  const RobotDescription robot = Slide();
  UnscentedObserver observer(robot);
  Random random(3, {1});
  joint_state_t m = Measured(0, 0.1, 0.3, 0);
  observer.OnJointState(m, Kinematic(m));
  Eigen::Vector2d mean(0.1, 0.3);
  Eigen::Matrix2d covariance = Eigen::Vector2d(1e-6, 1e-2).asDiagonal(), transition, noise;
  transition << 1, kPeriod, 0, 1;
  noise << std::pow(kPeriod, 3) / 3, kPeriod * kPeriod / 2, kPeriod * kPeriod / 2, kPeriod;
  noise *= 0.2 * 0.2;
  Eigen::Matrix2d rows;
  rows << 1, -kAge, 0, 1;
  for (int k = 1; k <= 400; ++k) {
    const double effort = random.Uniform(-2, 2), a = effort / kMass;
    const Eigen::Vector2d reading(0.1 + 0.3 * kPeriod * k + 1e-3 * random.Normal(),
                                  0.3 + 0.05 * random.Normal());
    const bool silent = k % 7 == 0;
    m = Measured(k, reading(0), reading(1), effort);
    m.valid[0] = !silent;
    observer.OnJointState(m, Kinematic(m));
    mean = (transition * mean + Eigen::Vector2d(kPeriod * kPeriod / 2, kPeriod) * a).eval();
    covariance = (transition * covariance * transition.transpose() + noise).eval();
    if (!silent) {
      const double displaced = mean(1) * kTiming;
      const Eigen::Vector2d variances(1e-6 + 0.04 * std::pow(kAge, 3) / 3 + displaced * displaced,
                                      0.0025 + 0.04 * kAge);
      const Eigen::Matrix2d spread =
          rows * covariance * rows.transpose() + Eigen::Matrix2d(variances.asDiagonal());
      const Eigen::Matrix2d gain = covariance * rows.transpose() * spread.inverse();
      const Eigen::Vector2d known(a * kAge * kAge / 2, -a * kAge);
      mean += gain * (reading - known - rows * mean);
      covariance = ((Eigen::Matrix2d::Identity() - gain * rows) * covariance).eval();
    }
    const robot_state_t& state = observer.state();
    REQUIRE(state.q[0] == Approx(mean(0)).margin(1e-9));
    REQUIRE(state.v[0] == Approx(mean(1)).margin(1e-8));
    REQUIRE(state.q_sd[0] == Approx(std::sqrt(covariance(0, 0))).epsilon(1e-7));
    REQUIRE(state.v_sd[0] == Approx(std::sqrt(covariance(1, 1))).epsilon(1e-7));
    REQUIRE(state.model_based);
    REQUIRE_FALSE(state.restarted);
    REQUIRE(state.sequence == k);
  }
  CHECK(observer.restarts() == 0);
}

TEST_CASE("a silent joint moves on as the simulator says, under efforts that are late") {
  RobotDescription robot = Slide();
  robot.joints[0].dynamics.delay = 0.012;  // not a whole number of periods
  UnscentedObserver observer(robot);
  joint_state_t m = Measured(0, 0.1, 0.3, 0);
  observer.OnJointState(m, Kinematic(m));
  std::vector<double> efforts = {0};
  for (int k = 1; k <= 50; ++k) {
    efforts.push_back(std::sin(k));
    m = Measured(k, 0, 0, efforts.back());
    m.valid[0] = 0;
    observer.OnJointState(m, Kinematic(m));
    // The effort applied from (j - 1) to j periods acts from 2.4 periods later on.
    double v = 0.3;
    for (int j = 1; j <= k; ++j)
      v += efforts[static_cast<size_t>(j)] / kMass * kPeriod *
           std::clamp(k - 2.4 - (j - 1), 0.0, 1.0);
    REQUIRE(observer.state().v[0] == Approx(v).margin(1e-9));
  }
}

// A pendulum that hangs still, without a motor, on whose link a gyro says that it turns.
TEST_CASE("a gyro's bias is told from a motion that the simulator does not expect") {
  RobotDescription robot = LoadPendulum("robot.toml");
  robot.parameters.clear();
  robot.virtual_robot.hidden.clear();
  robot.joints[0].passive = true;
  SensorDescription imu;
  imu.name = "imu";
  imu.period = kPeriod;
  imu.link = 1;
  imu.noise.position_sd = 0.01;
  imu.noise.velocity_sd = 0.01;
  imu.rate_bias_sd = 0.1;
  robot.sensors = {imu};
  UnscentedObserver observer(robot);
  for (int k = 0; k < 1000; ++k) {
    const joint_state_t m = Measured(k, M_PI, 0.2, NAN);  // of an effort that it cannot have
    observer.OnJointState(m, Kinematic(m, M_PI, 0));
  }
  CHECK(std::abs(observer.state().v[0]) < 0.01);
  CHECK(observer.state().v_sd[0] < 0.02);
  CHECK(observer.state().q[0] == Approx(M_PI).margin(0.005));
  CHECK(observer.restarts() == 0);
}

// Readings are late and biased, and so is the state: what it is for has only ever seen readings.
TEST_CASE("the state is what sensors read of the simulator's") {
  RobotDescription robot = Slide();
  robot.joints[0].dynamics.sensor_bias = 0.5;
  robot.joints[0].dynamics.stiffness = 8;  // relaxed at 0
  UnscentedObserver observer(robot);
  joint_state_t m = Measured(0, 0, 0, 0);
  observer.OnJointState(m, Kinematic(m, 0.5, 0));
  for (int k = 1; k <= 100; ++k) {
    m = Measured(k, 0, 0, 0);
    m.valid[0] = 0;
    observer.OnJointState(m, Kinematic(m, 0.5, 0));
  }
  CHECK(observer.state().q[0] == Approx(0.5).margin(1e-9));
}

TEST_CASE("the kinematic state is taken over where the filter cannot go on") {
  UnscentedObserver observer(Slide());
  joint_state_t m = Measured(0, 0.1, 0.3, 0);
  const auto step = [&](int64_t k, double q, double v, double effort,
                        bool valid = true) -> const robot_state_t& {
    m = Measured(k, 0.1, 0.3, effort);
    robot_state_t kinematic = Kinematic(m, q, v);
    kinematic.valid = valid;
    observer.OnJointState(m, kinematic);
    return observer.state();
  };
  const auto taken = [&](double q, double v) {
    const robot_state_t& s = observer.state();
    return s.q[0] == q && s.v[0] == v && s.q_sd[0] == Approx(1e-3).epsilon(1e-12) &&
           s.v_sd[0] == Approx(0.1).epsilon(1e-12);
  };
  step(0, 0.1, 0.3, 0);
  CHECK(taken(0.1, 0.3));
  step(1, 0.11, 0.31, 0);
  CHECK_FALSE(taken(0.11, 0.31));
  SECTION("while that is not valid, and once more when it has become so") {
    for (int k = 2; k < 5; ++k) {
      step(k, 0.11, 0.31, 0, false);
      CHECK(taken(0.11, 0.31));
      CHECK_FALSE(observer.state().valid);
    }
    step(5, 0.12, 0.32, 0);
    CHECK(taken(0.12, 0.32));
    CHECK(observer.restarts() == 0);
  }
  SECTION("under an effort that is not known") {
    step(2, 0.11, 0.31, std::numeric_limits<double>::quiet_NaN());
    CHECK(taken(0.11, 0.31));
    CHECK(observer.state().valid);
    CHECK(observer.restarts() == 0);
    step(3, 0.11, 0.31, 1);
    CHECK_FALSE(taken(0.11, 0.31));
  }
  SECTION("when the simulator has lost it") {
    int64_t k = 1;
    for (const double speed : {3e6, 1e200, -1e308}) {
      step(++k, 0.1, 0.3, 0, false);
      step(++k, 0.1, speed, 0);
      const int64_t before = observer.restarts();
      step(++k, 0.1, 0.3, 0);
      CHECK(taken(0.1, 0.3));
      CHECK(observer.state().restarted);
      CHECK(observer.restarts() == before + 1);
      step(++k, 0.1, 0.3, 0);
      CHECK_FALSE(observer.state().restarted);
      CHECK(observer.restarts() == before + 1);
    }
  }
  SECTION("when the drive contradicts it") {
    step(2, 5.1, 0.3, 0, false);
    step(3, 5.1, 0.3, 0);
    step(4, 0.11, 0.31, 0);  // the drive says 0.1
    CHECK(taken(0.11, 0.31));
    CHECK(observer.state().restarted);
    CHECK(observer.restarts() == 1);
  }
}

TEST_CASE("a spherical joint is refused by name") {
  RobotDescription robot = Slide();
  robot.joints[0].type = JointDescription::Type::kSpherical;
  CHECK_THROWS_WITH(UnscentedObserver(robot), Catch::Contains("joint pivot is spherical"));
}

TEST_CASE("a state that is valid is finite, whatever the drives say, and the truth comes back") {
  UnscentedObserver observer(Slide());
  int64_t k = 0;
  const auto tell = [&](double velocity, double effort) {
    const joint_state_t measured = Measured(k++, 0.1, velocity, effort);
    observer.OnJointState(measured, Kinematic(measured, 0.1, 0));
    const robot_state_t& state = observer.state();
    if (state.valid) {
      REQUIRE((std::isfinite(state.q[0]) && std::isfinite(state.v[0]) &&
               std::isfinite(state.q_sd[0]) && std::isfinite(state.v_sd[0])));
    }
  };
  for (int i = 0; i < 20; ++i) tell(0, 0);
  for (const double size : {1e5, 1e7, 9.9e8}) {
    for (const double sign : {-1., 1.}) tell(sign * size, 0), tell(0, sign * size);
    for (int i = 0; i < 50; ++i) tell(0, 0);
    CHECK(std::abs(observer.state().q[0] - 0.1) < 1e-2);
    CHECK(std::abs(observer.state().v[0]) < 0.1);
  }
}

}  // namespace
}  // namespace plumb
