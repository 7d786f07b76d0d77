#include "trainer/policy_file.h"

#include <fmt/format.h>

#include <filesystem>
#include <fstream>
#include <optional>
#include <stdexcept>

#include "trainer/checkpoint.h"
#include "trainer/onnx_policy.h"

namespace plumb {
namespace {

constexpr std::streamsize kMagicSize = 8;  // enough to tell the formats apart

/// The first bytes of a regular file, none of anything else.
std::string ReadMagic(const std::string& file) {
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(file, ignored)) return "";
  std::string magic(kMagicSize, '\0');
  std::ifstream stream(file, std::ios::binary);
  stream.read(magic.data(), kMagicSize);
  magic.resize(static_cast<size_t>(stream.gcount()));
  return magic;
}

/// @throws std::invalid_argument without the file's name.
void RequireFit(const GaussianPolicy& policy, const RobotDescription& robot, const Task& task) {
  if (policy.shape().observations != task.observation_size() ||
      policy.shape().actions != task.action_size()) {
    throw std::invalid_argument(
        fmt::format("the policy is for another robot or task: it turns {} observations into {} "
                    "actions, '{}' of robot '{}' has {} and {}",
                    policy.shape().observations, policy.shape().actions, robot.task.name,
                    robot.name, task.observation_size(), task.action_size()));
  }
  const Eigen::ArrayXf limits = robot.effort_limits().cast<float>();
  if (((policy.action_scale.array() - limits).abs() > 1e-4f * limits).any()) {
    throw std::invalid_argument(
        "the policy is for other effort limits: an action of 1 would be another effort");
  }
}

GaussianPolicy FromCheckpoint(const std::string& file) {
  const std::optional<Checkpoint> checkpoint = LoadCheckpoint(file);
  if (!checkpoint) throw std::invalid_argument(file + ": there is no such policy");
  try {
    return GaussianPolicy::FromMessage(DeployedPolicy(*checkpoint));
  } catch (const std::invalid_argument& error) {
    throw std::invalid_argument(file + ": " + error.what());
  }
}

}  // namespace

GaussianPolicy LoadPolicy(const std::string& file, const RobotDescription& robot,
                          const Task& task) {
  const std::string magic = ReadMagic(file);
  std::optional<PolicyRecord> record;
  std::optional<GaussianPolicy> policy;
  if (IsOnnx(magic)) {
    OnnxPolicy model = ReadOnnxPolicy(file);
    record = std::move(model.record);
    policy = std::move(model.policy);
  } else if (magic.empty() || IsCheckpoint(magic)) {
    policy = FromCheckpoint(file);
  } else {
    throw std::invalid_argument(file + ": is neither a trainer's checkpoint nor an ONNX model");
  }
  try {
    if (record) RequireSameTask(*record, robot, task);
    RequireFit(*policy, robot, task);
  } catch (const std::invalid_argument& error) {
    throw std::invalid_argument(file + ": " + error.what());
  }
  return *std::move(policy);
}

}  // namespace plumb
