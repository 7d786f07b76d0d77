#pragma once

#include <string>
#include <vector>

#include "robot/description.h"

namespace plumb {

// Before a long computation rather than after it. Empty names are passed over.

/// No output is one of the inputs, whatever name it goes by. Thread-safe.
/// @throws std::invalid_argument naming the file.
void RequireNotRead(const std::vector<std::string>& outputs,
                    const std::vector<std::string>& inputs);

/// No two outputs are one file, whatever names it goes by. Thread-safe.
/// @throws std::invalid_argument naming the file.
void RequireApart(const std::vector<std::string>& outputs);

/// Both, and every output can be written (RequireWritable). Thread-safe.
/// @throws std::runtime_error or std::invalid_argument naming the file.
void RequireOutputs(const std::vector<std::string>& outputs,
                    const std::vector<std::string>& inputs);

/// robot.toml, the files that it extends, and its URDF. Not thread-safe.
std::vector<std::string> FilesOf(const RobotDescription& robot);

/// A file that would be written over is of the kind that is going to be written, or empty.
/// @param begins what files of that kind begin with. @param kind "a report of ours"
/// @throws std::invalid_argument naming the file.
void RequireSameKind(const std::string& file, const std::string& begins, const std::string& kind);
/// The same of LCM's logs, which begin with the sync word of their first event.
void RequireLcmLog(const std::string& file);
/// A log that would be written over is empty, or LOG.d beside it says that it is of a run in
/// virtual time of this robot, which its command would make again.
/// @param robot its name, if what writes is such a run; else empty
/// @throws std::invalid_argument naming the file.
void RequireOverwritable(const std::string& log, const std::string& robot);

}  // namespace plumb
