#include "robot/residual.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

namespace plumb {

void ResidualFunction::Features(const Eigen::Ref<const Eigen::VectorXd>& x,
                                Eigen::Ref<Eigen::VectorXd> features) const {
  const Eigen::Index d = inputs(), m = phases.size();
  auto z = features.segment(1, d);
  features(0) = 1;
  z = ((x - mean).array() / scale.array()).max(low.array()).min(high.array());
  auto waves = features.tail(m);
  waves.noalias() = frequencies * z;
  waves += phases;
  const double amplitude = std::sqrt(2 / static_cast<double>(m));
  for (double& wave : waves) wave = amplitude * std::cos(wave);
  z /= std::sqrt(static_cast<double>(d));
}

void RequireFinite(const Residual& residual) {
  const auto require = [](bool good, const char* field) {
    if (!good) throw std::invalid_argument(std::string("residual: ") + field);
  };
  require(residual.margin >= 0 && std::isfinite(residual.margin), "margin is not a distance");
  for (const Eigen::VectorXd& draw : residual.coordinates)
    require(draw.allFinite(), "a draw is not finite");
  for (const auto* part : {&residual.free, &residual.touching}) {
    if (!*part) continue;
    const ResidualFunction& f = **part;
    require(f.mean.allFinite(), "mean is not finite");
    require(f.scale.allFinite() && f.scale.minCoeff() > 0, "scale is not positive");
    require(f.low.allFinite() && f.high.allFinite(), "low or high is not finite");
    require(f.frequencies.allFinite() && f.phases.allFinite(), "a wave is not finite");
    for (const Eigen::MatrixXd& weights : f.weights)
      require(weights.allFinite(), "weights are not finite");
    require(f.noise.allFinite(), "noise is not finite");
    require(f.bound.allFinite() && f.bound.minCoeff() > 0, "bound is not positive");
  }
}

ResidualSample::ResidualSample(const Residual& residual) : residual_(&residual) {
  if (residual.free) free_features_.resize(residual.free->features());
  if (residual.touching) touching_features_.resize(residual.touching->features());
  normal_.resize(residual.free       ? residual.free->outputs()
                 : residual.touching ? residual.touching->outputs()
                                     : 0);
  change_ = normal_;
}

void ResidualSample::Begin(size_t draw, Random& random) {
  draw_ = draw;
  random_ = Random(uint64_t{random.Bits()} << 32 | random.Bits());
}

const Eigen::VectorXd& ResidualSample::Step(bool touching,
                                            const Eigen::Ref<const Eigen::VectorXd>& x) {
  const auto& function = touching ? residual_->touching : residual_->free;
  if (!function) {
    change_.setZero();
    return change_;
  }
  Eigen::VectorXd& features = touching ? touching_features_ : free_features_;
  function->Features(x, features);
  change_.noalias() = function->weights[draw_] * features;
  change_ = change_.cwiseMax(-function->bound).cwiseMin(function->bound);
  for (double& normal : normal_) normal = random_.Normal();
  change_.noalias() += function->noise * normal_;
  return change_;
}

}  // namespace plumb
