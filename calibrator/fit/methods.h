#pragma once

#include <string>
#include <vector>

#include "calibrator/fit/method.h"

namespace plumb {

/// All methods, the default first. --method, its help and docs/inference.md are made of this table:
/// a new method is a line in its group, e.g. SearchMethods. Thread-safe, as all below.
const std::vector<Method>& Methods();

/// Their names.
const std::vector<std::string>& CalibrationMethods();

/// @throws std::invalid_argument naming the nearest method if there is none of that name.
void RequireMethod(const std::string& name);

/// @throws std::invalid_argument naming RobotDiscrepancies() if it is none of them.
void RequireDiscrepancy(const std::string& name);

/// Runs the method that input.options names. @throws std::invalid_argument if there is none of that
/// name, the discrepancy is none, whether the method needs it or not, or the data cannot be used.
MethodResult RunMethod(const MethodInput& input);

}  // namespace plumb
