#include "trainer/policy_file.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <filesystem>
#include <fstream>
#include <optional>
#include <stdexcept>

#include "controller/policy_fit.h"
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

Checkpoint ReadCheckpoint(const std::string& file) {
  std::optional<Checkpoint> checkpoint = LoadCheckpoint(file);
  if (!checkpoint) throw std::invalid_argument(file + ": there is no such policy");
  return *std::move(checkpoint);
}

GaussianPolicy FromCheckpoint(const std::string& file) {
  const Checkpoint checkpoint = ReadCheckpoint(file);
  try {
    return GaussianPolicy::FromMessage(DeployedPolicy(checkpoint));
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

void RequireTrained(const std::string& file, const RobotDescription& robot) {
  if (IsOnnx(ReadMagic(file))) return;
  const Checkpoint checkpoint = ReadCheckpoint(file);
  if (checkpoint.incumbent < 0 && checkpoint.iteration == 0 && !checkpoint.complete) {
    throw std::invalid_argument(
        fmt::format("{}: its training has not ended, after {} updates", file, checkpoint.updates));
  }
  // `plumb train` notes no robot.
  if (checkpoint.robot != 0 && checkpoint.robot != robot.fingerprint)
    spdlog::warn("{}: robot.toml or its URDF has changed since it was trained", file);
}

}  // namespace plumb
