#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "robot/description.h"

namespace plumb {

/// How a run of the loop went, for people: an HTML page that loads nothing.
/// @param summary as docs/summary.md has it; numbers may be null. @param command that was given.
/// Thread-safe. @throws nlohmann::json::exception if it is no summary.
std::string LaunchReport(const RobotDescription& robot, const nlohmann::json& summary,
                         const std::string& command);

/// What each report begins with. Thread-safe.
std::string LaunchReportBegins();

}  // namespace plumb
