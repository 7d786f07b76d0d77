#include "robot/residual.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "common/exponential.h"

namespace plumb {

ResidualFunction::Work ResidualFunction::MakeWork() const {
  return {centres.cast<float>(), centres.rowwise().squaredNorm() / 2, Eigen::VectorXf(inputs()),
          Eigen::VectorXf(centres.rows())};
}

void ResidualFunction::Features(const Eigen::Ref<const Eigen::VectorXd>& x, Work* work,
                                Eigen::Ref<Eigen::VectorXd> features) const {
  const Eigen::Index d = inputs();
  auto z = features.segment(1, d);
  auto bumps = features.tail(centres.rows());
  features(0) = 1;
  z = ((x - mean).array() / scale.array()).max(low.array()).min(high.array());
  work->z = z.cast<float>();
  work->products.noalias() = work->centres * work->z;
  // rounding may leave a distance that is negative
  bumps = (work->products.cast<double>().array() - work->half_squares.array() - z.squaredNorm() / 2)
              .min(0.0);
  ExpOfNegatives({bumps.data(), static_cast<size_t>(bumps.size())});
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
    require(f.centres.allFinite(), "a centre is not finite");
    for (const Eigen::MatrixXd& weights : f.weights)
      require(weights.allFinite(), "weights are not finite");
    require(f.noise.allFinite(), "noise is not finite");
    require(f.bound.allFinite() && f.bound.minCoeff() > 0, "bound is not positive");
  }
}

ResidualSample::ResidualSample(const Residual& residual) : residual_(&residual) {
  const auto prepare = [](const std::optional<ResidualFunction>& function, Part* part) {
    if (!function) return;
    *part = {function->MakeWork(), Eigen::VectorXd(function->features())};
  };
  prepare(residual.free, &free_), prepare(residual.touching, &touching_);
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
  Part& part = touching ? touching_ : free_;
  function->Features(x, &part.work, part.features);
  change_.noalias() = function->weights[draw_] * part.features;
  change_ = change_.cwiseMax(-function->bound).cwiseMin(function->bound);
  for (double& normal : normal_) normal = random_.Normal();
  change_.noalias() += function->noise * normal_;
  return change_;
}

}  // namespace plumb
