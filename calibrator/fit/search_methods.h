#pragma once

#include <vector>

#include "calibrator/fit/method.h"

namespace plumb {

/// reps and simopt: relative-entropy policy search, see RepsSearch.
std::vector<Method> SearchMethods();

}  // namespace plumb
