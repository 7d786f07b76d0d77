#include "calibrator/fit/robot_draws.h"

#include <cstdint>
#include <stdexcept>
#include <string>

namespace plumb {
namespace {

constexpr int64_t kTriesPerDraw = 100;  // until a distribution is taken for no robot's

}  // namespace

Eigen::MatrixXd DrawRobots(const Model& model, Eigen::Index count,
                           const std::function<Eigen::VectorXd()>& draw) {
  Eigen::MatrixXd draws(static_cast<Eigen::Index>(model.description().parameters.size()), count);
  Physics<double> physics = model.parameters().Nominal();
  std::string why;  // the last one was none
  int64_t tries = 0;
  for (Eigen::Index i = 0; i < count; ++tries) {
    if (tries >= kTriesPerDraw * count) {
      throw std::invalid_argument("less than one draw in a hundred is a robot: " + why +
                                  "; give the parameter coordinate = \"log\" in robot.toml");
    }
    draws.col(i) = draw();
    try {
      model.parameters().Apply(model.description().ToPhysical(draws.col(i)), &physics);
      ++i;
    } catch (const std::invalid_argument& error) {
      why = error.what();
    }
  }
  return draws;
}

}  // namespace plumb
