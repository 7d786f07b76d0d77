#pragma once

#include <map>
#include <string>
#include <vector>

#include "robot/parameters.h"

// The drawings of a run's report: each returns an <svg> element, or nothing where there is nothing
// to be seen. What is NaN is left out.
namespace plumb {

// The functions here share nothing: thread-safe.

/// What policies returned, by their numbers; of a run that went on, the later ones.
struct PolicyReturns {
  std::map<int, double> simulated, robot;  ///< of all but the last
  std::map<int, double> incumbent;  ///< the one that the robot was run with, after each was judged
  int last = 0;                     ///< number of the last one
  std::vector<double> in_the_end;   ///< roll-outs of the one that the robot is run with then
};
/// Against the policy: on the robot, in simulation, and as a line what the robot was run with.
std::string ReturnsPlot(const PolicyReturns& returns);

/// What was learnt of a parameter.
struct Learnt {
  int iteration;    ///< 1, 2, ...; of a run that went on, the later ones
  double mean, sd;  ///< after it, physical units
};
/// A parameter's mean and 95 % after each iteration, and its true value, if that is known. The axis
/// is that of what was learnt: a prior that is much wider goes out of the picture.
/// @param learnt of one iteration at least.
std::string LearnedPlot(const ParameterDescription& parameter, const std::vector<Learnt>& learnt,
                        double hidden);

}  // namespace plumb
