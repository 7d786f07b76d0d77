#pragma once

#include <string>

#include "controller/policy.h"
#include "robot/description.h"
#include "sim/tasks/task.h"

namespace plumb {

/// Reads a policy from a file: a trainer's checkpoint or an ONNX model that Plumbline has written
/// (trainer/onnx_policy.h), whichever it is by its contents; of several in a checkpoint the one
/// that the robot is to be run with. Thread-safe.
/// @throws std::invalid_argument or CheckpointError, naming the file, if there is none, it is
/// damaged, or the policy is another robot's or another task's: it sees or does something else, has
/// other effort limits or, as far as the file says, other names or another control period.
GaussianPolicy LoadPolicy(const std::string& file, const RobotDescription& robot, const Task& task);

/// Whether a robot may be run with a file's policy: it is an ONNX model's, or a checkpoint's of
/// which at least one training has ended. Warns where the robot's files have changed since.
/// Thread-safe. @throws std::invalid_argument if not, naming the file; as LoadPolicy.
void RequireTrained(const std::string& file, const RobotDescription& robot);

}  // namespace plumb
