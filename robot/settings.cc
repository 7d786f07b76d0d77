#include "robot/settings.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "robot/floating_base.h"

namespace plumb {
namespace {

constexpr Range kAtLeastOne{1, 1e9};
// Orders of magnitude beyond sense: what would overflow elsewhere is a mistake here.
constexpr Range kSanePositive{1e-12, 1e12}, kSaneNotNegative{0, 1e12};

const std::vector<std::string> kLiveMethods{"auto", "laplace", "mixture", "reps", "simopt"};

// Gravity may be left out; of a table that is there, nothing may.
World ReadWorld(Config& simulation, const SimulationSettings& settings) {
  using Table = WorldParameterKind::Table;
  World world;
  Config contact = simulation.Table("contact", false), limit = simulation.Table("limit", false);
  for (const WorldParameterKind& kind : kWorldParameterKinds) {
    if (!settings.Has(kind.table)) continue;
    Config& table = kind.table == Table::kContact ? contact
                    : kind.table == Table::kLimit ? limit
                                                  : simulation;
    const bool optional = kind.table == Table::kSimulation;
    kind.of(world) = optional ? table.Number(kind.key, kind.in_file, kind.of(world))
                              : table.Number(kind.key, kind.in_file);
  }
  if (settings.contact) world.contact.slip_speed = contact.Number("slip_speed", {1e-9, 1e6});
  contact.Finish();
  limit.Finish();
  return world;
}

UnmodelledJoint ReadUnmodelledJoint(Config& config, const RobotDescription& robot,
                                    const std::vector<UnmodelledJoint>& before) {
  UnmodelledJoint s;
  const std::string name = config.String("name");
  for (const int i : robot.driven()) {
    if (robot.joints[static_cast<size_t>(i)].name == name) s.joint = i;
  }
  if (s.joint < 0) config.Fail("name", fmt::format("= \"{}\" is not a joint with a motor", name));
  if (std::any_of(before.begin(), before.end(),
                  [&](const auto& other) { return other.joint == s.joint; })) {
    config.Fail("name", fmt::format("= \"{}\" occurs twice", name));
  }
  s.friction = config.Number("friction", {0, 1e9}, 0);
  s.delay = config.Number("delay", {0, JointDynamics::kLongestDelay}, 0);
  s.backlash = config.Number("backlash", {0, 1e3}, 0);
  if (s.backlash > 0) {
    s.rotor = config.Number("rotor", {1e-9, 1e9});
  } else if (config.Has("rotor")) {
    config.Fail(
        "rotor",
        "is what backlash parts from its joint, and there is none; without it write armature");
  }
  config.Finish();
  return s;
}

}  // namespace

DriverSettings ReadDriver(Config config, const std::vector<JointDescription>& joints) {
  DriverSettings s;
  s.cycle = config.Number("cycle", {1e-4, 1});
  s.measurement = config.Number("measurement", {1e-4, 1});
  s.expiry = config.Number("expiry", {1e-3, 1});
  s.disarm_after = config.Number("disarm_after", {1e-3, 10});
  s.stale_after = config.Number("stale_after", {1e-3, 1});
  s.heartbeat_timeout = config.Number("heartbeat_timeout", {1e-3, 10});
  s.start_guard = config.Number("start_guard", {0, 10});
  s.effort_delay = config.Number("effort_delay", {0, 0.01}, 0);
  s.telemetry = config.Number("telemetry", {1e-3, 10}, s.telemetry);
  s.stop = static_cast<DriverSettings::Stop>(config.Choice("stop", {"zero", "ramp", "damping"}, 0));
  if (s.stop == DriverSettings::Stop::kRamp) {
    s.ramp = config.Number("ramp", {1e-3, 10});
  } else if (config.Has("ramp")) {
    config.Fail("ramp", "is for stop = \"ramp\" only");
  }
  if (s.stop == DriverSettings::Stop::kDamping &&
      std::none_of(joints.begin(), joints.end(),
                   [](const auto& joint) { return joint.limits.damping > 0; })) {
    config.Fail("stop", "= \"damping\", but no joint has a damping in its [joint.limits]");
  }
  s.max_motor_temperature =
      config.Number("max_motor_temperature", {0, HUGE_VAL}, s.max_motor_temperature);
  s.max_drive_temperature =
      config.Number("max_drive_temperature", {0, HUGE_VAL}, s.max_drive_temperature);
  s.min_bus_voltage = config.Number("min_bus_voltage", kSaneNotNegative, s.min_bus_voltage);
  s.max_bus_voltage = config.Number("max_bus_voltage", {1e-3, HUGE_VAL}, s.max_bus_voltage);
  s.stuck_after = config.Number("stuck_after", {0, 3600}, s.stuck_after);
  if (s.expiry < 2 * s.cycle) config.Fail("expiry", "must be at least two cycles");
  if (s.disarm_after < s.expiry) config.Fail("disarm_after", "must not be shorter than expiry");
  if (s.stale_after < 2 * s.measurement)
    config.Fail("stale_after", "must be at least two measurement periods");
  // Rounded as the sum of two decimals may be.
  if (s.ramp > (s.disarm_after - s.expiry) * (1 + 1e-9)) {
    config.Fail("ramp",
                "must not be longer than disarm_after - expiry: the drives would be disarmed "
                "before its end");
  }
  if (!(s.min_bus_voltage < s.max_bus_voltage))
    config.Fail("min_bus_voltage", "must be below max_bus_voltage");
  config.Finish();
  return s;
}

EstimatorSettings ReadEstimator(Config config, const RobotDescription& robot) {
  EstimatorSettings s;
  s.position_sd = config.Number("position_sd", kSanePositive);
  s.velocity_sd = config.Number("velocity_sd", kSanePositive);
  s.jerk = config.Number("jerk", kSanePositive);
  s.effort_step = config.Number("effort_step", kSaneNotNegative);
  s.ground_impact = config.Number("ground_impact", kSaneNotNegative, s.ground_impact);
  s.stop_impact = config.Number("stop_impact", kSaneNotNegative, s.stop_impact);
  s.coupling = config.Number("coupling", {0, 1}, s.coupling);
  s.timing_sd = config.Number("timing_sd", kSaneNotNegative);
  s.lag = config.Integer("lag", {1, 1000});
  s.reset_after = config.Number("reset_after", kSanePositive);
  s.delay = config.Number("delay", {0, 0.1}, s.delay);
  s.outage = config.Number("outage", {1e-3, 1}, s.outage);
  Config model = config.Table("model", false);
  s.model_acceleration = model.Number("acceleration", kSanePositive, s.model_acceleration);
  model.Finish();
  s.base = static_cast<EstimatorSettings::Base>(config.Choice("base", {"sensors", "legs"}, 0));
  if (s.base == EstimatorSettings::Base::kLegs) {
    try {
      FloatingBaseOf(robot);
    } catch (const std::invalid_argument& error) {
      config.Fail("base", fmt::format("= \"legs\": {}", error.what()));
    }
    s.ground_sd = config.Number("ground_sd", kSanePositive, s.ground_sd);
    s.slip = config.Number("slip", kSanePositive, s.slip);
  }
  config.Finish();
  return s;
}

SimulationSettings ReadSimulation(Config config, double period) {
  SimulationSettings s;
  s.integrator = config.Choice("integrator", {"semi-implicit", "leapfrog"}) == 0
                     ? SimulationSettings::Integrator::kSemiImplicit
                     : SimulationSettings::Integrator::kLeapfrog;
  s.substep = config.Number("substep", {1e-6, 1});
  s.latency = config.Number("latency", kSaneNotNegative, 0);
  s.speed_clip = config.Number("speed_clip", {std::numeric_limits<double>::min()}, HUGE_VAL);
  s.move_before_clip = config.Boolean("move_before_clip", false);
  if (s.substep > period * (1 + 1e-9))
    config.Fail("substep", "must not be longer than task.period");
  if (s.latency >= period) config.Fail("latency", "must be shorter than task.period");
  if (config.Has("contact")) s.contact.emplace();
  if (config.Has("limit")) s.stop.emplace();
  s.set_world(ReadWorld(config, s));
  config.Finish();
  return s;
}

ControllerSettings ReadController(Config config) {
  ControllerSettings s;
  s.state_timeout = config.Number("state_timeout", {1e-3, 10});
  s.place_tolerance = config.Number("place_tolerance", kSanePositive);
  config.Finish();
  return s;
}

CalibrationSettings ReadCalibration(Config config) {
  CalibrationSettings s;
  s.method = kLiveMethods[static_cast<size_t>(config.Choice("method", kLiveMethods, 0))];
  s.samples = config.Integer("samples", {4, 1e6});
  s.updates = config.Integer("updates", {1, 1000});
  s.kl = config.Number("kl", kSanePositive);
  s.min_temperature = config.Number("min_temperature", kSanePositive);
  s.horizons = config.Integers("horizons", {1, 10000});
  if (s.horizons.empty()) config.Fail("horizons", "is empty");
  s.duration = config.Number("duration", {0, 1e6}, 0);
  config.Finish();
  return s;
}

TrainingSettings ReadTraining(Config config) {
  TrainingSettings s;
  s.batch = config.Integer("batch", {10, 1e7});
  s.updates = config.Integer("updates", kAtLeastOne);
  s.updates_again = config.Integer("updates_again", {0, 1e9});
  s.hidden = config.Integers("hidden", {1, 4096});
  s.gamma = config.Number("gamma", {0, 1});
  s.lambda = config.Number("lambda", {0, 1});
  s.kl = config.Number("kl", kSanePositive);
  s.damping = config.Number("damping", kSaneNotNegative);
  s.cg_iterations = config.Integer("cg_iterations", {1, 1000});
  s.fisher_fraction = config.Number("fisher_fraction", {1e-3, 1});
  s.critic_l2 = config.Number("critic_l2", kSaneNotNegative);
  s.critic_rate = config.Number("critic_rate", kSanePositive);
  s.critic_epochs = config.Integer("critic_epochs", {1, 10000});
  s.critic_minibatch = config.Integer("critic_minibatch", {1, 1e7});
  s.normalise_values = config.Boolean("normalise_values", true);
  s.normalise_observations = config.Boolean("normalise_observations", false);
  s.worst_share = config.Number("worst_share", {0.01, 1}, 1);
  s.worst_after = config.Integer("worst_after", {0, 1e9}, 100);
  s.duration = config.Number("duration", {0, 1e6}, 0);
  s.position_noise = config.Number("position_noise", kSaneNotNegative, 0);
  s.velocity_noise = config.Number("velocity_noise", kSaneNotNegative, 0);
  config.Finish();
  return s;
}

VirtualRobotSettings ReadVirtualRobot(Config config, const RobotDescription& robot) {
  VirtualRobotSettings s;
  s.watchdog = config.Number("watchdog", {0, 10});
  s.heartbeat = config.Number("heartbeat", {1e-3, 10});
  s.encoder_bits = config.Integer("encoder_bits", {4, 32});
  s.engine =
      static_cast<VirtualRobotSettings::Engine>(config.Choice("engine", {"auto", "mujoco"}, 0));
  s.engine_source = config.Position("engine");
  Config hidden = config.Table("hidden", false);
  for (const std::string& name : hidden.Keys()) {
    const std::vector<double> bounds = hidden.Numbers(name, 2, {-1e12, 1e12});
    if (!(bounds[0] <= bounds[1])) hidden.Fail(name, "must be [lower, upper]");
    if (robot.FindParameter(name) < 0) hidden.Fail(name, "is not one of the parameters");
    s.hidden.push_back({name, bounds[0], bounds[1]});
  }
  for (Config& joint : config.Tables("joint"))
    s.joints.push_back(ReadUnmodelledJoint(joint, robot, s.joints));
  config.Finish();
  return s;
}

}  // namespace plumb
