#include "robot/residual.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>

#include "common/decompositions.h"

namespace plumb {

using residual_kernels::Pack;

namespace {

constexpr float kNothing = 1e-12f;

}  // namespace

PackedMatrix::PackedMatrix(const Eigen::MatrixXd& matrix)
    : packs_(residual_kernels::Packs(static_cast<int>(matrix.rows()))),
      columns_(static_cast<int>(matrix.cols())),
      data_(static_cast<size_t>(packs_ * columns_)) {
  for (Eigen::Index j = 0; j < columns_; ++j) {
    for (Eigen::Index i = 0; i < matrix.rows(); ++i) {
      const auto number = static_cast<float>(matrix(i, j));
      // products of numbers that are next to nothing are subnormal, and slow
      data_[static_cast<size_t>(j * packs_ + i / Pack::kSize)].x[i % Pack::kSize] =
          std::abs(number) < kNothing ? 0 : number;
    }
  }
}

ResidualFunction::Work ResidualFunction::MakeWork() const {
  PackedMatrix packed(centres);
  Eigen::VectorXf half_squares = Eigen::VectorXf::Zero(packed.rows());
  half_squares.head(centres.rows()) = (centres.rowwise().squaredNorm() / 2).cast<float>();
  Eigen::VectorXf features = Eigen::VectorXf::Zero(1 + inputs() + packed.rows());
  return {std::move(packed), std::move(half_squares), Eigen::VectorXf(inputs()),
          std::move(features)};
}

void ResidualFunction::Features(const Eigen::Ref<const Eigen::VectorXd>& x, Work* work) const {
  const Eigen::Index d = inputs();
  work->z = ((x - mean).array() / scale.array()).max(low.array()).min(high.array()).cast<float>();
  work->features(0) = 1;
  work->features.segment(1, d) = work->z / std::sqrt(static_cast<float>(d));
  auto bumps = work->features.tail(work->centres.rows());
  residual_kernels::Multiply(work->centres.data(), work->centres.packs(), work->centres.columns(),
                             work->z.data(), bumps.data());
  bumps -= work->half_squares;
  bumps.array() -= work->z.squaredNorm() / 2;
  residual_kernels::ExpOfNegatives(bumps.data(), work->centres.packs());
}

Eigen::MatrixXd ResidualFunction::KernelFactor() const {
  const Eigen::ArrayXd halves = centres.rowwise().squaredNorm() / 2;
  Eigen::ArrayXXd kernel = (centres * centres.transpose()).array();
  kernel.colwise() -= halves;
  kernel.rowwise() -= halves.transpose();
  Eigen::MatrixXd matrix = kernel.exp();
  matrix.diagonal().array() += kNugget;
  return matrix.llt().matrixL();
}

void RequirePlausible(const Residual& residual) {
  const auto require = [](bool good, const char* field) {
    if (!good) throw std::invalid_argument(std::string("residual: ") + field);
  };
  const auto small = [](const auto& x) {
    return (x.array().abs() <= ResidualFunction::kMostChange).all();  // NaN is not
  };
  const auto near = [](const auto& x) {
    return (x.array().abs() <= ResidualFunction::kFarthest).all();
  };
  require(residual.margin >= 0 && std::isfinite(residual.margin), "margin is not a distance");
  for (const Eigen::VectorXd& draw : residual.coordinates)
    require(draw.allFinite(), "a draw is not finite");
  for (const Residual::Part& part : Residual::kParts) {
    if (!(residual.*part.function)) continue;
    const ResidualFunction& f = *(residual.*part.function);
    require(f.mean.allFinite(), "mean is not finite");
    require(f.scale.allFinite() && f.scale.minCoeff() > 0, "scale is not positive");
    require(near(f.low) && near(f.high), "low or high is not finite, or too far away");
    require((f.low.array() <= f.high.array()).all(), "low is above high");
    require(near(f.centres), "a centre is not finite, or too far away");
    for (const Eigen::MatrixXd& weights : f.weights)
      require(weights.allFinite(), "weights are not finite");
    require(small(f.noise), "noise is larger than what a simulator can lack");
    require(f.bound.minCoeff() > 0, "bound is not positive");
    require(small(f.bound), "bound is larger than what a simulator can lack");
    require(f.unknown.minCoeff() >= 0, "unknown is negative");
    require(small(f.unknown), "unknown is larger than what a simulator can lack");
  }
}

const std::array<Residual::Part, 4> Residual::kParts{{{"free", &Residual::free, false},
                                                      {"touching", &Residual::touching, false},
                                                      {"ground", &Residual::ground, true},
                                                      {"stop", &Residual::stop, true}}};

ResidualSample::Part ResidualSample::Prepare(const std::optional<ResidualFunction>& function,
                                             Eigen::Index outputs) {
  Part part;
  part.change = Eigen::VectorXd::Zero(function ? function->outputs() : outputs);
  if (!function) return part;
  part.function = &*function;
  part.work = function->MakeWork();
  for (const Eigen::MatrixXd& weights : function->weights) part.weights.emplace_back(weights);
  part.known.resize(part.weights.front().rows());
  // square with what fills it up, too
  const Eigen::Index m = function->centres.rows(), filled = part.work.centres.rows();
  Eigen::MatrixXd inverse = Eigen::MatrixXd::Zero(filled, filled);
  inverse.topLeftCorner(m, m) = function->KernelFactor().triangularView<Eigen::Lower>().solve(
      Eigen::MatrixXd::Identity(m, m));
  part.whitening = PackedMatrix(inverse);
  part.whitened.resize(filled);
  part.lasting = part.normal = part.change;
  part.noisy = !function->noise.isZero(0);
  return part;
}

ResidualSample::ResidualSample(const Residual& residual) {
  const auto outputs = [](const auto& function, const auto& other) {
    return function ? function->outputs() : other ? other->outputs() : 0;
  };
  free_ = Prepare(residual.free, outputs(residual.touching, residual.free));
  touching_ = Prepare(residual.touching, outputs(residual.free, residual.touching));
  ground_ = Prepare(residual.ground, 0);
  stop_ = Prepare(residual.stop, 0);
}

void ResidualSample::Begin(size_t draw, Random& random) {
  draw_ = draw;
  const uint64_t high = random.Bits();
  random_ = Random(high << 32 | random.Bits());
  for (Part* part : {&free_, &touching_, &ground_, &stop_}) {
    for (double& normal : part->lasting) normal = random_.Normal();
  }
}

const Eigen::VectorXd& ResidualSample::Change(Part& part,
                                              const Eigen::Ref<const Eigen::VectorXd>& x) {
  if (!part.function) return part.change;
  const ResidualFunction& function = *part.function;
  function.Features(x, &part.work);
  const Eigen::VectorXf& features = part.work.features;
  const PackedMatrix& weights = part.weights[draw_];
  residual_kernels::Multiply(weights.data(), weights.packs(), weights.columns(), features.data(),
                             part.known.data());
  const auto bumps = features.tail(part.whitened.size());
  residual_kernels::MultiplyLower(part.whitening.data(), part.whitening.packs(), bumps.data(),
                                  part.whitened.data());
  const double unknown = std::max(0.0, 1.0 - static_cast<double>(part.whitened.squaredNorm()));
  Eigen::VectorXd& change = part.change;
  change = part.known.head(change.size()).cast<double>();
  change += std::sqrt(unknown) * function.unknown.cwiseProduct(part.lasting);
  change = change.cwiseMax(-function.bound).cwiseMin(function.bound);
  if (!part.noisy) return change;
  for (double& normal : part.normal) normal = random_.Normal();
  change.noalias() += function.noise * part.normal;
  return change;
}

}  // namespace plumb
