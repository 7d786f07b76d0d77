// A torso that slides along x and z, turns about y, and carries an IMU.

#include <Eigen/Geometry>
#include <catch2/catch.hpp>
#include <cmath>

#include "common/random.h"
#include "estimator/state_observer.h"
#include "robot/motion_noise.h"

namespace plumb {
namespace {

RobotDescription Torso() {
  using Type = JointDescription::Type;
  RobotDescription robot{};
  robot.links.resize(4);
  const auto add = [&](const char* name, Type type, Eigen::Vector3d axis, int parent) {
    JointDescription joint;
    joint.name = name;
    joint.type = type;
    joint.axis = axis;
    joint.parent = parent;
    joint.child = parent + 1;
    joint.passive = true;
    robot.joints.push_back(joint);
  };
  add("x", Type::kPrismatic, Eigen::Vector3d::UnitX(), 0);
  add("z", Type::kPrismatic, Eigen::Vector3d::UnitZ(), 1);
  add("pitch", Type::kRevolute, Eigen::Vector3d::UnitY(), 2);
  robot.joints[0].passive = false;  // somebody must drive
  robot.joints[0].effort_limit = 1;
  robot.estimator = {.position_sd = 1e-3,
                     .velocity_sd = 0.5,
                     .jerk = 50,
                     .effort_step = 0,
                     .timing_sd = 0,
                     .lag = 10,
                     .reset_after = 0.5};
  SensorDescription imu;
  imu.name = "imu";
  imu.period = 0.005;
  imu.link = 3;
  imu.noise.position_sd = 1e-3;
  imu.noise.velocity_sd = 0.02;
  imu.rate_bias_sd = 0.05;
  imu.acceleration_sd = 0.2;
  imu.acceleration_bias_sd = 0.1;
  robot.sensors.push_back(imu);
  return robot;
}

struct Rig {
  explicit Rig(const RobotDescription& description) : robot(description), observer(description) {}

  static Eigen::Vector3d Q(double t) {
    return {0.3 * std::sin(5 * t), 1 + 0.2 * std::cos(7 * t), 0.4 * std::sin(4 * t)};
  }
  static Eigen::Vector3d Rates(double t) { return (Q(t + 1e-5) - Q(t - 1e-5)) / 2e-5; }
  Eigen::Vector3d Accelerations(double t) const {
    return (Rates(t + 1e-4) - Rates(t - 1e-4)) / 2e-4;
  }

  joint_state_t State(int k) {
    const double t = 0.002 * k;
    joint_state_t m{};
    m.utime = 1'000'000 + 2000 * k;
    m.sequence = k;
    m.num_joints = 3;
    m.effort_measured = m.effort_sent = m.effort_applied = {0., 0., 0.};
    m.valid = {1, 1, 1};
    const int at_imu = k * 2 / 5;  // readings of the IMU, every 5 ms
    m.measured = {m.utime, m.utime, 1'000'000 + 5000 * at_imu};
    for (int i = 0; i < 2; ++i) {
      m.position.push_back(Q(t)[i] + 1e-3 * random.Normal());
      m.velocity.push_back(NAN);
    }
    if (at_imu != last_imu) {
      last_imu = at_imu;
      angle = Q(0.005 * at_imu)[2] + 1e-3 * random.Normal();
      rate = Rates(0.005 * at_imu)[2] + gyro_bias + 0.02 * random.Normal();
    }
    m.position.push_back(angle);
    m.velocity.push_back(rate);
    return m;
  }
  imu_t Imu(int k) {
    const double t = 0.005 * k;
    imu_t imu{};
    imu.name = "imu";
    imu.link = "torso";
    imu.utime = 1'000'000 + 5000 * k;
    const Eigen::Quaterniond turn(Eigen::AngleAxisd(Q(t)[2], Eigen::Vector3d::UnitY()));
    // averaged over a period
    const Eigen::Vector3d a = (Accelerations(t) + Accelerations(t - 0.005)) / 2;
    const Eigen::Vector3d force =
        turn.conjugate() * Eigen::Vector3d(a[0], 0, a[1] + robot.simulation.gravity);
    for (int i = 0; i < 3; ++i) imu.force[i] = force[i] + 0.2 * random.Normal() + force_offset[i];
    imu.rate[1] = rate;
    imu.orientation[0] = turn.w();
    imu.orientation[2] = turn.y();
    imu.orientation_valid = true;
    return imu;
  }
  struct Errors {
    Eigen::Vector3d q = Eigen::Vector3d::Zero(), v = q, nees = q;
  };
  /// rms and mean normalised squared error of v of the last part.
  Errors Run(int steps, bool with_imu) {
    Errors e;
    int n = 0;
    for (int k = 0; k < steps; ++k) {
      if (with_imu && k % 5 == 0) observer.OnImu(Imu(2 * k / 5));
      if (with_imu && k % 5 == 3) observer.OnImu(Imu(2 * (k - 3) / 5 + 1));
      REQUIRE(observer.OnJointState(State(k)));
      if (k < steps / 4) continue;
      ++n;
      for (int i = 0; i < 3; ++i) {
        const auto at = static_cast<size_t>(i);
        const double dq = observer.state().q[at] - Q(0.002 * k)[i],
                     dv = observer.state().v[at] - Rates(0.002 * k)[i];
        e.q[i] += dq * dq;
        e.v[i] += dv * dv;
        e.nees[i] += std::pow(dv / observer.state().v_sd[at], 2);
      }
    }
    return {(e.q / n).cwiseSqrt(), (e.v / n).cwiseSqrt(), e.nees / n};
  }

  RobotDescription robot{};
  StateObserver observer;
  Random random{9, {2}};
  double gyro_bias = 0, angle = 0, rate = 0;
  Eigen::Vector3d force_offset = Eigen::Vector3d::Zero();
  int last_imu = -1;
};

TEST_CASE("noise is each sensor's own, and the joint's word is the last") {
  RobotDescription robot = Torso();
  CHECK(EstimatorOf(robot, 0).position_sd == 1e-3);
  CHECK(EstimatorOf(robot, 0).acceleration_sd == 0.2);
  CHECK(EstimatorOf(robot, 0).bias_sd == 0.1);
  CHECK(EstimatorOf(robot, 2).velocity_sd == 0.02);
  CHECK(EstimatorOf(robot, 2).bias_sd == 0.05);
  CHECK(EstimatorOf(robot, 2).acceleration_sd == 0);
  robot.joints[2].noise.velocity_sd = 0.03;
  robot.joints[2].noise.jerk = 7;
  CHECK(EstimatorOf(robot, 2).velocity_sd == 0.03);
  CHECK(EstimatorOf(robot, 2).jerk == 7);
  CHECK(EstimatorOf(robot, 1).jerk == 50);
}

TEST_CASE("an accelerometer makes the velocities of slides better, whatever the pitch") {
  Rig with(Torso()), without(Torso());
  const auto better = with.Run(4000, true), worse = without.Run(4000, false);
  for (int i = 0; i < 2; ++i) {
    INFO("joint " << i << ": " << better.v[i] << " instead of " << worse.v[i] << ", NEES "
                  << better.nees[i]);
    CHECK(better.v[i] < 0.85 * worse.v[i]);
    CHECK(better.nees[i] < 2);
  }
  const estimator_status_t status = with.observer.Status();
  CHECK(status.imu_readings > 1500);
  CHECK(status.imu_refused == 0);
  for (const std::string& reason : status.joint_reason) CHECK(reason.empty());
}

TEST_CASE("the gyro's bias is found, and one beyond reason is named") {
  Rig rig(Torso());
  SECTION("in order") {
    rig.gyro_bias = 0.08;
    const auto e = rig.Run(8000, true);
    CHECK(rig.observer.Status().bias[2] == Approx(0.08).margin(0.02));
    CHECK(e.v[2] < 0.04);
    CHECK(rig.observer.Status().joint_reason[2].empty());
  }
  SECTION("beyond reason") {
    rig.gyro_bias = 0.5;
    rig.Run(8000, true);
    CHECK_THAT(rig.observer.Status().joint_reason[2], Catch::Contains("gyro"));
  }
  SECTION("an accelerometer that says something else than the boom") {
    rig.force_offset[0] = 6;
    rig.Run(2000, true);
    CHECK_THAT(rig.observer.Status().joint_reason[0], Catch::Contains("acceleration disagree"));
  }
}

TEST_CASE("readings of an IMU out of order, twice, late, or rubbish are told apart") {
  Rig ordered(Torso()), disordered(Torso());
  for (int k = 0; k < 100; ++k) {
    REQUIRE(ordered.observer.OnJointState(ordered.State(k)));
    REQUIRE(disordered.observer.OnJointState(disordered.State(k)));
  }
  const imu_t first = ordered.Imu(41), second = ordered.Imu(42);
  ordered.observer.OnImu(first);
  ordered.observer.OnImu(second);
  for (const imu_t* imu : {&second, &first, &second}) disordered.observer.OnImu(*imu);
  imu_t wrong = ordered.Imu(43);
  wrong.force[1] = NAN;
  disordered.observer.OnImu(wrong);
  wrong = ordered.Imu(43);
  wrong.name = "another";
  disordered.observer.OnImu(wrong);
  disordered.observer.OnImu(ordered.Imu(10));  // long past
  wrong = ordered.Imu(43);
  wrong.utime = std::numeric_limits<int64_t>::max();
  disordered.observer.OnImu(wrong);
  for (int k = 100; k < 120; ++k) {
    // The random numbers of the two rigs differ by now: both get the same message.
    const joint_state_t m = ordered.State(k);
    REQUIRE(ordered.observer.OnJointState(m));
    REQUIRE(disordered.observer.OnJointState(m));
    CHECK(ordered.observer.state().v == disordered.observer.state().v);
  }
  const estimator_status_t status = disordered.observer.Status();
  CHECK(status.imu_readings == 2);
  CHECK(status.imu_reordered == 1);
  CHECK(status.imu_duplicates == 1);
  CHECK(status.imu_refused == 4);
}

TEST_CASE("a flood of readings is bounded") {
  Rig rig(Torso());
  for (int k = 0; k < 1000; ++k) rig.observer.OnImu(rig.Imu(k));
  CHECK(rig.observer.Status().imu_refused == 1000 - 32);
}

}  // namespace
}  // namespace plumb
