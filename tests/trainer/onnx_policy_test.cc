#include "trainer/onnx_policy.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <limits>
#include <nlohmann/json.hpp>

#include "tests/cli/shell.h"
#include "tests/temporary_folder.h"
#include "tests/trainer/sample_policy.h"
#include "trainer/checkpoint.h"
#include "trainer/policy_file.h"

namespace plumb {
namespace {

using Catch::Contains;
using nlohmann::json;

std::vector<float> Bits(const GaussianPolicy& policy) {
  std::vector<float> all;
  for (const Eigen::VectorXf* v : {&policy.parameters, &policy.observation_mean,
                                   &policy.observation_scale, &policy.action_scale}) {
    all.insert(all.end(), v->begin(), v->end());
  }
  return all;
}

bool SameBits(const GaussianPolicy& a, const GaussianPolicy& b) {
  const std::vector<float> one = Bits(a), other = Bits(b);
  return a.shape() == b.shape() &&
         std::memcmp(one.data(), other.data(), one.size() * sizeof(float)) == 0;
}

std::string Source() { return std::getenv("PLUMBLINE_SOURCE"); }

TEST_CASE("a policy and its record survive ONNX to the bit") {
  for (const PolicyShape& shape :
       {kSmall, PolicyShape{1, {}, 1}, PolicyShape{11, {64, 64}, 3},
        PolicyShape{2, {1, 2, 3, 4, 5, 6, 7, 8}, 4}, PolicyShape{500, {1000, 700}, 7}}) {
    GaussianPolicy policy = RandomPolicy(shape);
    policy.parameters[0] = -0.0f;
    policy.parameters[policy.parameters.size() - 1] = std::numeric_limits<float>::denorm_min();
    const PolicyRecord record = RecordOf(shape);
    const OnnxPolicy read = DecodeOnnxPolicy(EncodeOnnxPolicy(policy, record));
    CHECK(SameBits(read.policy, policy));
    CHECK(read.record == record);
  }
  // Entries that may be missing.
  PolicyRecord record = RecordOf(kSmall);
  record.training_return.reset();
  record.evaluation.clear();
  CHECK(DecodeOnnxPolicy(EncodeOnnxPolicy(RandomPolicy(kSmall), record)).record == record);
}

TEST_CASE("a file of a policy is written whole, and named where it cannot be") {
  const TemporaryFolder folder;
  const OnnxPolicy policy{RandomPolicy(kSmall), RecordOf(kSmall)};
  WriteOnnxPolicy(folder / "p.onnx", policy);
  CHECK(SameBits(ReadOnnxPolicy(folder / "p.onnx").policy, policy.policy));
  CHECK(Read(folder / "p.onnx") == SmallModel());
  CHECK(std::distance(std::filesystem::directory_iterator(folder.path()), {}) == 1);
  CHECK_THROWS_WITH(WriteOnnxPolicy("/nonexistent/p.onnx", policy),
                    Contains("/nonexistent/p.onnx"));
  CHECK_THROWS_WITH(ReadOnnxPolicy(folder / "none"),
                    Contains(folder / "none") && Contains("cannot be opened"));
  CHECK_THROWS_AS(ReadOnnxPolicy(folder / "none"), std::invalid_argument);

  const auto refused = [&](const OnnxPolicy& wrong, const std::string& why) {
    CHECK_THROWS_WITH(WriteOnnxPolicy(folder / "w.onnx", wrong),
                      Contains(folder / "w.onnx") && Contains(why));
    CHECK_FALSE(std::filesystem::exists(folder / "w.onnx"));
  };
  OnnxPolicy wrong = policy;
  wrong.policy.parameters[3] = NAN;
  refused(wrong, "not finite");
  wrong = policy;
  wrong.policy.action_scale[1] = 0;
  refused(wrong, "not positive");
  wrong = policy;
  wrong.record.observation_names.pop_back();
  refused(wrong, "2 names of observations, not 3");
  wrong = policy;
  wrong.record.training_return = NAN;
  refused(wrong, "'training_return' is not finite");
  wrong = policy;
  wrong.record.evaluation["mean_return"] = INFINITY;
  refused(wrong, "'evaluation'");
  wrong = policy;
  wrong.record.period = 0;
  refused(wrong, "'period' is not positive");
  const PolicyShape large{10, {2000, 2100}, 1};
  refused({RandomPolicy(large), RecordOf(large)}, "longer than 16 MB");
}

TEST_CASE("a program that knows no policies computes what the policy does") {
  const TemporaryFolder folder;
  Random random(7);
  for (const PolicyShape& shape : {kSmall, PolicyShape{1, {}, 1}, PolicyShape{11, {64, 64}, 3},
                                   PolicyShape{3, {128, 128}, 1}}) {
    const GaussianPolicy policy = RandomPolicy(shape, 5);
    WriteOnnxPolicy(folder / "p.onnx", {policy, RecordOf(shape)});
    json observations = json::array(), actions = json::array(), efforts = json::array();
    int beyond = 0;
    for (int row = 0; row < 200; ++row) {
      Eigen::VectorXf observation(shape.observations);
      // from row 100 on some are clipped
      const double spread = row < 100 ? 3 : row < 190 ? 30 : 1e6;
      for (float& entry : observation) entry = static_cast<float>(random.Uniform(-spread, spread));
      const Eigen::VectorXf action = policy.Mean(observation);
      const Eigen::VectorXf effort =
          action.cwiseMax(-1).cwiseMin(1).cwiseProduct(policy.action_scale);
      beyond += (action.array().abs() > 1).any();
      observations.push_back(std::vector<float>(observation.begin(), observation.end()));
      actions.push_back(std::vector<float>(action.begin(), action.end()));
      efforts.push_back(std::vector<float>(effort.begin(), effort.end()));
    }
    CHECK(beyond > 0);
    CHECK(beyond < 200);
    const std::vector<float> log_std(policy.log_std().begin(), policy.log_std().end());
    const std::vector<float> scale(policy.action_scale.begin(), policy.action_scale.end());
    const std::vector<float> ones(static_cast<size_t>(shape.actions), 1);
    std::ofstream(folder / "cases.json")
        << json{{"inputs", {{"observation", observations}}},
                {"outputs", {{"effort", efforts}, {"action", actions}, {"log_std", log_std}}},
                {"units", {{"effort", scale}, {"action", ones}, {"log_std", ones}}}};
    const Outcome outcome =
        Shell("/usr/bin/python3 " + Source() + "/tests/trainer/onnx_reader.py " +
              folder / "p.onnx" + " " + folder / "cases.json" + " 1e-6");
    INFO(outcome.text);
    CHECK(outcome.status == 0);
  }
}

TEST_CASE("a policy is loaded from either file, and only for its own robot and task") {
  const TemporaryFolder folder;
  const RobotDescription robot = LoadRobot(Source() + "/robots/pendulum");
  const auto task = MakeTask(robot);
  GaussianPolicy policy = RandomPolicy({3, {4}, 1});
  policy.action_scale = robot.effort_limits().cast<float>();
  const PolicyRecord record = MakePolicyRecord(robot, *task);
  CHECK(record.robot == "pendulum");
  CHECK(record.action_names == std::vector<std::string>{"pivot"});
  CHECK(record.action_units == std::vector<std::string>{"Nm"});
  CHECK_THAT(record.version, Contains("plumb "));
  const std::string file = folder / "of any name";
  WriteOnnxPolicy(file, {policy, record});
  CHECK(SameBits(LoadPolicy(file, robot, *task), policy));
  Checkpoint checkpoint{};
  checkpoint.policy = policy.ToMessage();
  SaveCheckpoint(file, checkpoint);
  CHECK(SameBits(LoadPolicy(file, robot, *task), policy));

  const auto refused = [&](const std::string& words,
                           const std::function<void(PolicyRecord&)>& change) {
    PolicyRecord other = record;
    change(other);
    WriteOnnxPolicy(file, {policy, other});
    CHECK_THROWS_WITH(LoadPolicy(file, robot, *task), Contains(file) && Contains(words));
    CHECK_THROWS_AS(LoadPolicy(file, robot, *task), std::invalid_argument);
  };
  refused("another robot: \"hopper\", not \"pendulum\"",
          [](PolicyRecord& r) { r.robot = "hopper"; });
  refused("another task: \"reach\"", [](PolicyRecord& r) { r.task = "reach"; });
  refused("another control period [s]: 0.02, not 0.05", [](PolicyRecord& r) { r.period = 0.02; });
  refused("list of observations",
          [](PolicyRecord& r) { std::swap(r.observation_names[0], r.observation_names[1]); });
  refused("driven joints", [](PolicyRecord& r) { r.action_names = {"knee"}; });
  refused("units of effort", [](PolicyRecord& r) { r.action_units = {"N"}; });
  refused("...", [](PolicyRecord& r) { r.robot = std::string(10'000, 'x'); });

  policy.action_scale *= 2;
  WriteOnnxPolicy(file, {policy, record});
  CHECK_THROWS_WITH(LoadPolicy(file, robot, *task), Contains("effort limits"));
  std::ofstream(file) << "neither";
  CHECK_THROWS_WITH(LoadPolicy(file, robot, *task), Contains(file + ": is neither"));
}

}  // namespace
}  // namespace plumb
