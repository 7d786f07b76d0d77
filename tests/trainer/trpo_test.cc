#include "trainer/trpo.h"

#include <catch2/catch.hpp>
#include <cmath>

#include "tests/trainer/pendulum.h"
#include "tests/trainer/reference_network.h"
#include "trainer/initialization.h"

namespace plumb {
namespace {

/// A policy and what it did at random observations, with random advantages.
struct Fixture {
  explicit Fixture(int samples = 400) : settings(PendulumSettings()), policy({4, {24, 17}, 2}) {
    Random random(21);
    policy.parameters.head(policy.parameters.size() - 2) =
        OrthogonalParameters(policy.shape().sizes(), .5, random);
    policy.parameters.tail(2) << -.3f, .2f;
    observations = RandomMatrix(4, samples, 1, random);
    actions.resize(2, samples);
    for (int i = 0; i < samples; ++i) {
      actions.col(i) = policy.Sample(observations.col(i), random);
      advantages.push_back(random.Normal());
    }
    settings.fisher_fraction = 1;
  }
  PolicySamples samples() const {
    return {{observations.data(), static_cast<size_t>(observations.size())},
            {actions.data(), static_cast<size_t>(actions.size())},
            advantages};
  }
  Eigen::VectorXf RandomDirection(uint32_t seed) const {
    Random random(seed);
    return RandomMatrix(policy.parameters.size(), 1, 1, random);
  }
  ReferenceNetwork reference() const { return {policy.shape().sizes()}; }
  Eigen::VectorXd Weights(const Eigen::VectorXd& all) const { return all.head(all.size() - 2); }

  TrainingSettings settings;
  GaussianPolicy policy;
  Eigen::MatrixXf observations, actions;
  std::vector<double> advantages;
};

/// mean(exp(ln p(a) - ln p_old(a)) * advantage) in double, as a function of the parameters.
double Surrogate(const Fixture& f, const Eigen::VectorXd& parameters) {
  const auto log_density = [&](const Eigen::VectorXd& p) -> Eigen::ArrayXd {
    const Eigen::MatrixXd means =
        f.reference().Outputs(f.Weights(p), f.observations.cast<double>());
    const Eigen::VectorXd log_std = p.tail(2);
    Eigen::ArrayXd result = Eigen::ArrayXd::Zero(means.cols());
    for (int a = 0; a < 2; ++a) {
      const Eigen::ArrayXd z =
          (f.actions.row(a).cast<double>() - means.row(a)).array().transpose() /
          std::exp(log_std[a]);
      result -= z.square() / 2 + log_std[a];
    }
    return result;
  };
  const Eigen::VectorXd old = f.policy.parameters.cast<double>();
  return ((log_density(parameters) - log_density(old)).exp() *
          Eigen::Map<const Eigen::ArrayXd>(f.advantages.data(),
                                           static_cast<Eigen::Index>(f.advantages.size())))
      .mean();
}

/// Gradient in double of the mean KL(old || new) at `parameters`.
Eigen::VectorXd KlGradient(const Fixture& f, const Eigen::VectorXd& parameters) {
  const Eigen::VectorXd old = f.policy.parameters.cast<double>();
  const Eigen::MatrixXd x = f.observations.cast<double>();
  const Eigen::MatrixXd moved =
      f.reference().Outputs(f.Weights(parameters), x) - f.reference().Outputs(f.Weights(old), x);
  const Eigen::VectorXd variance = (2 * parameters.tail(2).array()).exp(),
                        old_variance = (2 * old.tail(2).array()).exp();
  const Eigen::MatrixXd output_gradient =
      variance.cwiseInverse().asDiagonal() * moved / static_cast<double>(x.cols());
  Eigen::VectorXd gradient(parameters.size());
  gradient.head(parameters.size() - 2) =
      f.reference().Backward(f.Weights(parameters), x, output_gradient);
  for (int a = 0; a < 2; ++a) {
    gradient[parameters.size() - 2 + a] =
        1 - (old_variance[a] + moved.row(a).array().square().mean()) / variance[a];
  }
  return gradient;
}

TEST_CASE("The surrogate's gradient is that of finite differences in double") {
  const Fixture f;
  Workers workers(1);
  Trpo trpo(f.settings, f.policy.shape(), workers);
  std::vector<float> means;
  const Eigen::VectorXd gradient =
      trpo.SurrogateGradient(f.policy, f.samples(), means).cast<double>();
  const Eigen::VectorXd p = f.policy.parameters.cast<double>();
  // Every seventh parameter, and the deviations.
  double error = 0, square = 0;
  for (Eigen::Index i = p.size() - 1; i >= 0; i -= i < p.size() - 2 ? 7 : 1) {
    Eigen::VectorXd step = Eigen::VectorXd::Zero(p.size());
    step[i] = 1e-5;
    const double difference = (Surrogate(f, p + step) - Surrogate(f, p - step)) / 2e-5;
    error += std::pow(gradient[i] - difference, 2);
    square += difference * difference;
  }
  CHECK(std::sqrt(error / square) < 1e-4);
}

TEST_CASE("Fisher's product is the derivative of the divergence's gradient") {
  const Fixture f;
  Workers workers(1);
  Trpo trpo(f.settings, f.policy.shape(), workers);
  trpo.PrepareFisher(f.policy, f.samples());
  const Eigen::VectorXd p = f.policy.parameters.cast<double>();
  for (uint32_t seed = 0; seed < 3; ++seed) {
    const Eigen::VectorXf v = f.RandomDirection(seed);
    const Eigen::VectorXd step = 1e-5 * v.cast<double>();
    const Eigen::VectorXd expected = (KlGradient(f, p + step) - KlGradient(f, p - step)) / 2e-5;
    CHECK(RelativeError(trpo.FisherProduct(v).cast<double>(), expected) < 1e-5);
  }
}

TEST_CASE(
    "Fisher's matrix is symmetric and positive semidefinite, also on a fifth of the samples") {
  Fixture f;
  for (const double fraction : {1., .2}) {
    f.settings.fisher_fraction = fraction;
    Workers workers(1);
    Trpo trpo(f.settings, f.policy.shape(), workers);
    trpo.PrepareFisher(f.policy, f.samples());
    for (uint32_t seed = 0; seed < 5; ++seed) {
      const Eigen::VectorXf u = f.RandomDirection(2 * seed), v = f.RandomDirection(2 * seed + 1);
      const Eigen::VectorXd fu = trpo.FisherProduct(u).cast<double>(),
                            fv = trpo.FisherProduct(v).cast<double>();
      const double ufv = u.cast<double>().dot(fv), vfu = v.cast<double>().dot(fu);
      const double size = std::sqrt(u.cast<double>().dot(fu) * v.cast<double>().dot(fv));
      CHECK(std::abs(ufv - vfu) < 1e-5 * size);
      CHECK(u.cast<double>().dot(fu) > 0);
    }
  }
}

TEST_CASE("A step stays within the trust region, uses it, and improves the surrogate") {
  Fixture f(2000);
  Workers workers(2);
  Trpo trpo(f.settings, f.policy.shape(), workers);
  const Fixture before = f;
  const Trpo::Step step = trpo.Improve(f.policy, f.samples());
  REQUIRE(step.accepted);
  CHECK(step.kl <= f.settings.kl);
  CHECK(step.kl >= .3 * f.settings.kl);
  const double gain = Surrogate(before, f.policy.parameters.cast<double>()) -
                      Surrogate(before, before.policy.parameters.cast<double>());
  CHECK(gain > 0);
  CHECK(step.surrogate_gain == Approx(gain).epsilon(1e-3));
}

TEST_CASE("The divergence reported is that of the Gaussians") {
  Fixture f(3);
  Workers workers(1);
  Trpo trpo(f.settings, f.policy.shape(), workers);
  GaussianPolicy after = f.policy;
  after.parameters += .05f * f.RandomDirection(3);
  std::vector<float> means;
  double expected = 0;
  for (int i = 0; i < 3; ++i) {
    const Eigen::VectorXf m = f.policy.Mean(f.observations.col(i)),
                          n = after.Mean(f.observations.col(i));
    means.insert(means.end(), m.begin(), m.end());
    for (int a = 0; a < 2; ++a) {
      const double s = std::exp(f.policy.log_std()[a]), t = std::exp(after.log_std()[a]),
                   d = m[a] - n[a];
      expected += std::log(t / s) + (s * s + d * d) / (2 * t * t) - .5;
    }
  }
  CHECK(trpo.Compare(f.policy, means, after, f.samples()).kl == Approx(expected / 3).epsilon(1e-4));
}

TEST_CASE("When the line search fails the policy is what it was, bit by bit") {
  Fixture f;
  // The curvature is looked at where the network does nothing, every fifth sample: the step is then
  // far too long.
  f.settings.fisher_fraction = .2;
  f.settings.damping = 1e-9;
  for (int i = 0; i < f.observations.cols(); i += 5) f.observations.col(i).setZero();
  Workers workers(1);
  Trpo trpo(f.settings, f.policy.shape(), workers);
  const Eigen::VectorXf before = f.policy.parameters;
  const Trpo::Step step = trpo.Improve(f.policy, f.samples());
  CHECK_FALSE(step.accepted);
  CHECK_THAT(step.failure, Catch::Contains("line search"));
  CHECK(step.tries == 10);
  CHECK(f.policy.parameters == before);
}

TEST_CASE("Advantages that are not finite, or all zero, change nothing") {
  Fixture f;
  Workers workers(1);
  Trpo trpo(f.settings, f.policy.shape(), workers);
  const Eigen::VectorXf before = f.policy.parameters;
  f.advantages[7] = std::nan("");
  CHECK_THAT(trpo.Improve(f.policy, f.samples()).failure, Catch::Contains("not finite"));
  CHECK(f.policy.parameters == before);
  std::fill(f.advantages.begin(), f.advantages.end(), 0);
  CHECK_FALSE(trpo.Improve(f.policy, f.samples()).accepted);
  CHECK(f.policy.parameters == before);
}

TEST_CASE("Exploration does not die out") {
  Fixture f;
  f.policy.parameters.tail(2).setConstant(Trpo::kMinLogStd);
  for (int i = 0; i < f.actions.cols(); ++i) {
    f.actions.col(i) =
        f.policy.Mean(f.observations.col(i));  // the mean was best: a smaller deviation is better
    f.advantages[static_cast<size_t>(i)] = 1;
  }
  Workers workers(1);
  Trpo trpo(f.settings, f.policy.shape(), workers);
  trpo.Improve(f.policy, f.samples());
  CHECK(f.policy.log_std().minCoeff() >= Trpo::kMinLogStd);
}

}  // namespace
}  // namespace plumb
