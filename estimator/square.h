#pragma once

namespace plumb {

inline constexpr double Square(double x) { return x * x; }

}  // namespace plumb
