#include "robot/settings/task.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "robot/joints.h"

namespace plumb {
namespace {

constexpr Range kAnyTarget{-1e9, 1e9}, kLengthOrAngle{0, 1e9};

// A table of joints: `read` is told the key and the joint, and where its coordinates begin.
template <typename Read>
void ReadByJoint(Config config, const std::vector<JointDescription>& joints,
                 const std::vector<LinkDescription>& links, const Read& read) {
  for (const std::string& key : config.Keys()) {
    if (IsFixedJoint(links, key)) config.Fail(key, "is fixed: it does not move");
  }
  size_t at = 0;
  for (const JointDescription& joint : joints) {
    if (config.Has(joint.name)) read(config, joint, at);
    at += static_cast<size_t>(joint.num_positions());
  }
  config.Finish();
}

void ReadTarget(Config& config, const JointDescription& joint, double* target) {
  if (joint.type != JointDescription::Type::kSpherical) {
    *target = config.Number(joint.name, kAnyTarget);
    if (*target < joint.lower || *target > joint.upper) {
      config.Fail(joint.name, fmt::format("= {} is beyond the joint's limits [{}, {}]", *target,
                                          joint.lower, joint.upper));
    }
    return;
  }
  const std::vector<double> q = config.Numbers(joint.name, 4, {-1.001, 1.001});
  const double norm = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  if (std::abs(norm - 1) > 1e-3) config.Fail(joint.name, "is not a unit quaternion [w, x, y, z]");
  for (size_t i = 0; i < 4; ++i) target[i] = q[i] / norm;
}

}  // namespace

TaskSettings ReadTask(Config config, const std::vector<JointDescription>& joints,
                      const std::vector<LinkDescription>& links) {
  TaskSettings s;
  s.name = config.String("name");
  s.period = config.Number("period", {1e-3, 10});
  s.steps = config.Integer("steps", {1, 1e6});
  for (const JointDescription& joint : joints) {
    s.target.push_back(joint.num_positions() == 4 ? 1 : 0);
    s.target.resize(s.target.size() + static_cast<size_t>(joint.num_positions()) - 1);
  }
  s.spread.resize(s.target.size());
  ReadByJoint(config.Table("target", false), joints, links,
              [&](Config& table, const JointDescription& joint, size_t at) {
                ReadTarget(table, joint, &s.target[at]);
              });
  if (config.IsTable("spread")) {
    ReadByJoint(config.Table("spread"), joints, links,
                [&](Config& table, const JointDescription& joint, size_t at) {
                  std::fill_n(&s.spread[at], joint.num_positions(),
                              table.Number(joint.name, kLengthOrAngle));
                });
  } else {
    std::fill(s.spread.begin(), s.spread.end(), config.Number("spread", kLengthOrAngle, 0));
  }
  s.fall.resize(s.target.size());
  ReadByJoint(config.Table("fall", false), joints, links,
              [&](Config& table, const JointDescription& joint, size_t at) {
                std::fill_n(&s.fall[at], joint.num_positions(),
                            table.Number(joint.name, kPositive));
              });
  s.velocity = config.Numbers("velocity", 3, {-10, 10}, s.velocity);
  config.Finish();
  return s;
}

}  // namespace plumb
