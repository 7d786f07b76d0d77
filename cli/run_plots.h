#pragma once

#include <string>
#include <vector>

#include "robot/parameters.h"

// The drawings of a run's report: each returns an <svg> element, or nothing where there is nothing
// to be seen. What is NaN is left out.
namespace plumb {

// The functions here share nothing: thread-safe.

/// What policies 0, 1, ... returned.
struct PolicyReturns {
  std::vector<double> simulated, robot;  ///< of all but the last
  std::vector<double> incumbent;   ///< the one that the robot was run with, after each was judged
  std::vector<double> in_the_end;  ///< roll-outs of the one that the robot is run with then
};
/// Against the policy: on the robot, in simulation, and as a line what the robot was run with.
std::string ReturnsPlot(const PolicyReturns& returns);

/// A parameter's mean and 95 % after each iteration, and its true value, if that is known. The axis
/// is that of what was learnt: a prior that is much wider goes out of the picture.
/// @param mean,sd of iterations 1, 2, ..., physical units.
std::string LearnedPlot(const ParameterDescription& parameter, const std::vector<double>& mean,
                        const std::vector<double>& sd, double hidden);

}  // namespace plumb
