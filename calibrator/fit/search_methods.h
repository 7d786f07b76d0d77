#pragma once

#include <vector>

#include "calibrator/fit/method.h"

namespace plumb {

// The functions here share nothing: thread-safe.

/// reps and simopt: relative-entropy policy search, see RepsSearch.
std::vector<Method> SearchMethods();

}  // namespace plumb
