#pragma once

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "common/random.h"
#include "controller/policy.h"
#include "trainer/onnx_policy.h"
#include "trainer/policy_record.h"

namespace plumb {

/// Sums of weights of the order of 1, as in a network that has been trained, and a normaliser that
/// is not the identity.
inline GaussianPolicy RandomPolicy(const PolicyShape& shape, uint64_t seed = 1) {
  GaussianPolicy policy(shape);
  Random random(seed);
  const auto fill = [&](Eigen::Ref<Eigen::VectorXf> values, double mean, double spread) {
    for (float& value : values) value = static_cast<float>(mean + random.Uniform(-spread, spread));
  };
  const std::vector<int> sizes = shape.sizes();
  Eigen::Index next = 0;
  for (size_t layer = 1; layer < sizes.size(); ++layer) {
    const int count = (sizes[layer - 1] + 1) * sizes[layer];
    fill(policy.parameters.segment(next, count), 0, std::sqrt(3.0 / sizes[layer - 1]));
    next += count;
  }
  fill(policy.parameters.tail(shape.actions), -1, 1);
  fill(policy.observation_mean, 0, 3);
  fill(policy.observation_scale, 2, 1.9);
  fill(policy.action_scale, 100, 99);
  return policy;
}

/// All entries, with texts and numbers that do not survive careless writing.
inline PolicyRecord RecordOf(const PolicyShape& shape) {
  PolicyRecord record;
  record.robot = "quoted \"robot\"\n";
  record.task = "";
  for (int i = 0; i < shape.observations; ++i)
    record.observation_names.push_back("o" + std::to_string(i) + " [m²]");
  for (int i = 0; i < shape.actions; ++i)
    record.action_names.push_back("joint, " + std::to_string(i));
  record.action_units.assign(static_cast<size_t>(shape.actions), "Nm");
  record.period = 1.0 / 3;
  record.posterior = "posterior.json 0123456789abcdef";
  record.version = "plumb 0";
  record.seed = std::numeric_limits<uint64_t>::max();
  record.steps = std::numeric_limits<int64_t>::max();
  record.training_return = -0.1 - 0.2;
  record.evaluation = {{"mean_return", -1.0 / 7}, {"episodes", 100}};
  return record;
}

inline const PolicyShape kSmall{3, {4, 5}, 2};

/// The bytes of a model in ONNX.
inline std::string SmallModel() { return EncodeOnnxPolicy(RandomPolicy(kSmall), RecordOf(kSmall)); }

}  // namespace plumb
