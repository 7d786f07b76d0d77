// Three biases that step-based calibration invites, each designed out and each shown to come back
// when the design is undone. The robot here is the virtual robot's own plant (its own equations and
// integrator) behind a 14-bit encoder, an effort that arrives 7 ms after the state it answers, and
// the real estimator.

#include <catch2/catch.hpp>
#include <cmath>

#include "calibrator/live/simopt.h"
#include "estimator/state_observer.h"
#include "sim/virtual/encoder.h"
#include "sim/virtual/simbody_plant.h"
#include "tests/calibrator/fitted_log.h"
#include "tests/calibrator/synthetic.h"

namespace plumb {
namespace {

const Eigen::Vector3d kBiasedTruth(9.3, 0.93, 1.07);
constexpr int64_t kMeasurement = 5000, kPeriod = 50'000, kLatency = 7000;  // [us]

struct Recording {
  std::vector<robot_state_t> causal, smoothed;
  std::vector<joint_command_t> commands;
};

Recording Record(const RobotDescription& robot, uint32_t episode) {
  SimbodyPlant plant(Model(robot).Describe(kBiasedTruth));
  Encoder encoder(robot.virtual_robot.encoder_bits);
  StateObserver observer(robot);
  Random random(23, {episode});
  Recording recording;

  const double turn = 2 * M_PI;
  plant.SetState(Eigen::VectorXd::Constant(1, random.Uniform(-3, 3)),
                 Eigen::VectorXd::Constant(1, random.Uniform(-1, 1)));
  encoder.Reset(plant.q()(0) / turn, plant.v()(0) / turn);
  Eigen::VectorXd effort = Eigen::VectorXd::Zero(1), next = effort;
  for (int64_t t = 0, k = 0; t <= 201 * kPeriod; t += kMeasurement, ++k) {
    // The command that answers the state at a multiple of the period reaches the motor kLatency
    // later.
    double impulse = 0;
    for (int64_t at = t; at < t + kMeasurement; at += 1000) {
      if (at % kPeriod == kLatency) effort = next;
      const double q0 = plant.q()(0), v0 = plant.v()(0);
      if (t > 0 || at > 0) {
        plant.Advance(effort, 1e-3);
        encoder.Track(
            {at, at + 1000, q0 / turn, plant.q()(0) / turn, v0 / turn, plant.v()(0) / turn});
      }
      impulse += effort(0) * 1e-3;
    }
    joint_state_t measured{};
    measured.utime = 1'000'000 + t + kMeasurement;
    measured.sequence = k;
    measured.num_joints = 1;
    measured.measured = {measured.utime};
    measured.position = {encoder.Quantise(plant.q()(0) / turn) * turn};
    measured.velocity = {encoder.velocity() * turn};
    measured.effort_applied = {impulse / (kMeasurement * 1e-6)};
    measured.effort_sent = measured.effort_measured = {effort(0)};
    measured.valid = {1};
    observer.OnJointState(measured);
    recording.causal.push_back(observer.state());
    recording.smoothed.insert(recording.smoothed.end(), observer.smoothed().begin(),
                              observer.smoothed().end());
    if ((t + kMeasurement) % kPeriod == 0 && t >= 2 * kPeriod) {
      joint_command_t command{};
      command.state_sequence = k;
      command.episode = episode;
      command.step = static_cast<int>(recording.commands.size());
      command.num_joints = 1;
      // As a swing-up does: pumping energy, with some noise.
      const double pump = observer.state().v[0] > 0 ? 1.5 : -1.5;
      next(0) = std::clamp(pump + random.Normal(), -2.0, 2.0);
      command.effort = {next(0)};
      recording.commands.push_back(command);
    }
  }
  return recording;
}

std::vector<Recording> Recordings(const RobotDescription& robot) {
  std::vector<Recording> recordings;
  for (uint32_t episode = 0; episode < 4; ++episode) recordings.push_back(Record(robot, episode));
  return recordings;
}
/// The pendulum's as it is, which all tests read that change nothing in the estimator.
const std::vector<Recording>& Recordings() {
  static const std::vector<Recording> recordings = Recordings(Pendulum());
  return recordings;
}

struct Undone {
  bool latency = false;    // each step is replayed with its command from beginning to end
  bool smoothing = false;  // the causal states are used
};

std::vector<Rollout> Rollouts(const RobotDescription& robot,
                              const std::vector<Recording>& recordings, Undone undone = {}) {
  std::vector<Rollout> rollouts;
  for (const Recording& recording : recordings) {
    TransitionJoiner joiner(robot);
    for (const robot_state_t& state : undone.smoothing ? recording.causal : recording.smoothed)
      joiner.OnState(state);
    for (const joint_command_t& command : recording.commands) joiner.OnCommand(command);
    Rollout rollout =
        joiner.Join(recording.commands.front().episode,
                    recording.commands.back().state_sequence + kPeriod / kMeasurement);
    REQUIRE(rollout.transitions.size() > 150);
    if (undone.latency) {
      for (Transition& t : rollout.transitions) {
        for (EffortSegment& segment : t.efforts)
          segment.effort(0) = recording.commands[static_cast<size_t>(t.step)].effort[0];
      }
    }
    rollouts.push_back(std::move(rollout));
  }
  return rollouts;
}

struct Errors {
  double gravity_over_length, mass_length_squared;  // relative
  double sd_gravity, sd_mass;                       // what the posterior claims
};

Errors Calibrate(const RobotDescription& robot, const std::vector<Rollout>& rollouts) {
  const Eigen::Vector3d truth = kBiasedTruth.array().log();
  const Gaussian posterior = LaplacePosterior(robot, rollouts, truth);
  const Eigen::Vector3d a(1, 0, -1), b(0, 1, 2);
  return {a.dot(posterior.mean - truth), b.dot(posterior.mean - truth),
          std::sqrt(a.dot(posterior.covariance * a)), std::sqrt(b.dot(posterior.covariance * b))};
}

TEST_CASE(
    "through encoder, latency and estimator the parameters are found within half a percent, and "
    "honestly") {
  const RobotDescription robot = Pendulum();
  const Errors found = Calibrate(robot, Rollouts(robot, Recordings()));
  INFO("g/l " << found.gravity_over_length << " +- " << found.sd_gravity << ", m l^2 "
              << found.mass_length_squared << " +- " << found.sd_mass);
  CHECK(std::abs(found.gravity_over_length) < 0.005);
  CHECK(std::abs(found.mass_length_squared) < 0.005);
  CHECK(std::abs(found.gravity_over_length) < 3 * found.sd_gravity);
  CHECK(std::abs(found.mass_length_squared) < 3 * found.sd_mass);
}

TEST_CASE("what the live calibrator claims to know of smoothed states is true") {
  const RobotDescription robot = Pendulum();
  SimOpt simopt(robot, 1, 2, "auto");
  const Eigen::Vector3d truth = kBiasedTruth.array().log();
  for (Rollout& rollout : Rollouts(robot, Recordings())) {
    simopt.Begin({std::move(rollout)});
    const auto report = simopt.Update();
    REQUIRE(report);
    const Gaussian found = Moments(simopt.state().distribution);
    for (const Eigen::Vector3d& power : {Eigen::Vector3d(1, 0, -1), Eigen::Vector3d(0, 1, 2)}) {
      const double error = power.dot(found.mean - truth),
                   sd = std::sqrt(power.dot(found.covariance * power));
      INFO("after " << report->iteration << " roll-outs: " << error << " +- " << sd);
      CHECK(std::abs(error) < 2.5 * sd);
      CHECK(sd < 0.01);
    }
  }
}

TEST_CASE("without the applied effort, latency becomes mass") {
  const RobotDescription robot = Pendulum();
  const Errors found = Calibrate(robot, Rollouts(robot, Recordings(), {.latency = true}));
  INFO("m l^2 " << found.mass_length_squared);
  CHECK(std::abs(found.mass_length_squared) > 0.03);
}

TEST_CASE("with a coarse integrator, its error becomes gravity or mass") {
  RobotDescription robot = Pendulum();
  const std::vector<Rollout> rollouts = Rollouts(robot, Recordings());
  robot.simulation.integrator = SimulationSettings::Integrator::kSemiImplicit;
  robot.simulation.substep = 0.005;
  const Errors found = Calibrate(robot, rollouts);
  INFO("g/l " << found.gravity_over_length << ", m l^2 " << found.mass_length_squared);
  CHECK(std::max(std::abs(found.gravity_over_length), std::abs(found.mass_length_squared)) > 0.005);
}

TEST_CASE("with corners rounded off by the filter, or lagging states, the effort seems weaker") {
  RobotDescription robot = Pendulum();
  SECTION("corners") {
    robot.estimator.jerk = 10;  // a narrow filter has round corners
    const Errors open = Calibrate(robot, Rollouts(robot, Recordings(robot)));
    robot.estimator.effort_step = 0;
    const Errors found = Calibrate(robot, Rollouts(robot, Recordings(robot)));
    INFO("m l^2 " << found.mass_length_squared << ", with the corners left open "
                  << open.mass_length_squared);
    CHECK(std::abs(found.mass_length_squared) > 0.01);
    CHECK(std::abs(open.mass_length_squared) < 0.005);
  }
  SECTION("causal") {
    const Errors found = Calibrate(robot, Rollouts(robot, Recordings(), {.smoothing = true}));
    INFO("g/l " << found.gravity_over_length << ", m l^2 " << found.mass_length_squared);
    CHECK(std::max(std::abs(found.gravity_over_length), std::abs(found.mass_length_squared)) >
          0.005);
  }
}

TEST_CASE(
    "through encoder, latency and estimator a right model raises no alarm, and one without the "
    "latency does") {
  const RobotDescription robot = Pendulum();
  const Misspecification right = FittedLog(robot, Rollouts(robot, Recordings())).Find();
  INFO(right.summary);
  CHECK_FALSE(right.alarm);
  const Misspecification wrong =
      FittedLog(robot, Rollouts(robot, Recordings(), {.latency = true})).Find();
  INFO(wrong.summary);
  CHECK(wrong.alarm);
  CHECK_THAT(wrong.summary, Catch::Contains("delay/pivot 0.007"));
}

}  // namespace
}  // namespace plumb
