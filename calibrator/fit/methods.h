#pragma once

#include <string>
#include <vector>

#include "calibrator/fit/method.h"

namespace plumb {

/// All methods, the default first: what there is to parse, run, help with and write about. A new one
/// is a line in its group, e.g. SearchMethods, and one in docs/inference.md. Thread-safe, as all
/// below.
const std::vector<Method>& Methods();

/// Their names.
const std::vector<std::string>& CalibrationMethods();

/// @throws std::invalid_argument naming the nearest method if there is none of that name.
void RequireMethod(const std::string& name);

/// Runs the method that input.options names. @throws std::invalid_argument if there is none of that
/// name, or the data cannot be used.
MethodResult RunMethod(const MethodInput& input);

}  // namespace plumb
