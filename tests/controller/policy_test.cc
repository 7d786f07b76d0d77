#include "controller/policy.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <limits>

namespace plumb {
namespace {

GaussianPolicy SmallPolicy() {
  GaussianPolicy policy({3, {5, 4}, 2});
  Random random(3);
  for (float& value : policy.parameters) value = static_cast<float>(random.Uniform(-1, 1));
  policy.observation_mean << .5f, -1, 0;
  policy.observation_scale << 2, .5f, 1;
  policy.action_scale << 2, 7;
  return policy;
}

/// The same network by indices, in double.
std::vector<double> MeanByHand(const GaussianPolicy& policy, const Eigen::VectorXf& observation) {
  std::vector<double> x;
  for (Eigen::Index i = 0; i < observation.size(); ++i) {
    x.push_back((double{observation[i]} - policy.observation_mean[i]) /
                policy.observation_scale[i]);
  }
  const std::vector<int> sizes = policy.shape().sizes();
  Eigen::Index next = 0;
  for (size_t layer = 1; layer < sizes.size(); ++layer) {
    const int in = sizes[layer - 1], out = sizes[layer];
    std::vector<double> y(static_cast<size_t>(out));
    for (int i = 0; i < out; ++i) {
      double sum = policy.parameters[next + in * out + i];
      for (int j = 0; j < in; ++j)
        sum += double{policy.parameters[next + j * out + i]} * x[static_cast<size_t>(j)];
      y[static_cast<size_t>(i)] = layer + 1 < sizes.size() ? std::tanh(sum) : sum;
    }
    next += (in + 1) * out;
    x = y;
  }
  return x;
}

TEST_CASE("The mean is the network's output, layer by layer") {
  const GaussianPolicy policy = SmallPolicy();
  CHECK(policy.shape().parameter_count() == 3 * 5 + 5 + 5 * 4 + 4 + 4 * 2 + 2 + 2);
  const Eigen::VectorXf observation = Eigen::Vector3f(.3f, -1.2f, 2.5f);
  const Eigen::VectorXf mean = policy.Mean(observation);
  const std::vector<double> expected = MeanByHand(policy, observation);
  CHECK(mean[0] == Approx(expected[0]).margin(2e-6));
  CHECK(mean[1] == Approx(expected[1]).margin(2e-6));
}

TEST_CASE("Samples scatter about the mean by exp(log_std)") {
  GaussianPolicy policy = SmallPolicy();
  policy.parameters.tail(2) << -1, .5f;
  const Eigen::VectorXf observation = Eigen::Vector3f(0, 0, 1);
  const Eigen::VectorXf mean = policy.Mean(observation);
  Random random(11);
  Eigen::Vector2d sum(0, 0), squares(0, 0);
  const int count = 20000;
  for (int i = 0; i < count; ++i) {
    const Eigen::Vector2d offset = (policy.Sample(observation, random) - mean).cast<double>();
    sum += offset;
    squares += offset.cwiseAbs2();
  }
  for (int i = 0; i < 2; ++i) {
    const double sd = std::exp(double{policy.log_std()[i]});
    CHECK(sum[i] / count == Approx(0).margin(4 * sd / std::sqrt(count)));
    CHECK(std::sqrt(squares[i] / count) == Approx(sd).epsilon(.03));
  }
}

TEST_CASE("Outliers are clipped before the network, NaN is not hidden") {
  const GaussianPolicy policy = SmallPolicy();
  CHECK(policy.Normalize(Eigen::Vector3f(1e9f, -1e9f, 3)) == Eigen::Vector3f(10, -10, 3));
  CHECK(std::isnan(policy.Mean(Eigen::Vector3f(NAN, 0, 0))[0]));
}

TEST_CASE("A policy survives its message bit by bit") {
  const GaussianPolicy policy = SmallPolicy();
  const GaussianPolicy again = GaussianPolicy::FromMessage(policy.ToMessage());
  CHECK(again.shape() == policy.shape());
  CHECK(again.parameters == policy.parameters);
  CHECK(again.observation_mean == policy.observation_mean);
  CHECK(again.observation_scale == policy.observation_scale);
  CHECK(again.action_scale == policy.action_scale);
}

TEST_CASE("Hostile policies are refused with a reason") {
  policy_t message = SmallPolicy().ToMessage();
  const auto refused_for = [&](const std::string& reason) {
    CHECK_THROWS_WITH(GaussianPolicy::FromMessage(message), Catch::Contains(reason));
  };
  SECTION("iteration") { message.iteration = -1, refused_for("iteration -1"); }
  SECTION("purpose") { message.purpose = 2, refused_for("purpose 2"); }
  SECTION("episodes") { message.episodes = -1, refused_for("-1 episodes"); }
  SECTION("more episodes than anybody wants") {
    message.episodes = 1 << 30, refused_for("episodes");
  }
  SECTION("layers announced") { message.num_layers = 3, refused_for("layers"); }
  SECTION("negative layers") { message.num_layers = -1, refused_for("layers"); }
  SECTION("no hidden or output layer") {
    message.num_layers = 1, message.size = {3}, refused_for("1 layers");
  }
  SECTION("empty layer") { message.size[1] = 0, refused_for("a layer of 0"); }
  SECTION("negative layer") { message.size[1] = -5, refused_for("a layer of -5"); }
  SECTION("huge layer") { message.size[1] = 1 << 30, refused_for("a layer of"); }
  SECTION("huge network") {
    message.num_layers = 9, message.size.assign(9, 4096), refused_for("parameters");
  }
  SECTION("weights missing") { message.weight.pop_back(), refused_for("weights, expected 56"); }
  SECTION("weights announced") { message.num_weights = 1, refused_for("1 weights, expected 56"); }
  SECTION("NaN weight") { message.weight[7] = NAN, refused_for("weights are not finite"); }
  SECTION("observation means") {
    message.observation_mean[0] = INFINITY, refused_for("observation means");
  }
  SECTION("observation count") { message.num_observations = 2, refused_for("2 observation means"); }
  SECTION("zero scale") {
    message.observation_scale[2] = 0, refused_for("observation scales are not positive");
  }
  SECTION("denormal scale") { message.observation_scale[2] = 1e-40f, refused_for("not positive"); }
  SECTION("negative action scale") { message.action_scale[0] = -2, refused_for("action scales"); }
  SECTION("action count") { message.num_actions = 3, refused_for("3 action scales"); }
}

}  // namespace
}  // namespace plumb
