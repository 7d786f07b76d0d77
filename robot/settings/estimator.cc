#include "robot/settings/estimator.h"

#include <fmt/format.h>

#include <stdexcept>

#include "robot/description.h"
#include "robot/floating_base.h"
#include "robot/settings/ranges.h"

namespace plumb {

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
    s.creep = config.Number("creep", {0, 10}, s.creep);
  }
  config.Finish();
  return s;
}

}  // namespace plumb
