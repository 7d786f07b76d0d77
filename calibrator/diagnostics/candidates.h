#pragma once

#include <Eigen/Core>
#include <functional>
#include <string>
#include <vector>

#include "robot/description.h"

namespace plumb {

// The functions here share nothing: thread-safe if the given function is, which the caller's thread
// calls.

/// A parameter of the simulator that is not fitted, and so may be what the model has wrong.
struct Candidate {
  std::string path;  ///< see sim/parameters.h
  std::string unit;
  double value;  ///< that the simulator has, physical units
  /// > 0, physical units: how much of a surprise is still a likely one (a standard deviation)
  double scale;
  double lower;  ///< the least value there is: 0, or -infinity
};

/// Gravity, contact and stops; each link's mass, inertia and centre of mass; the numbers of each
/// joint that kJointParameterKinds calls a likely surprise: what of these the robot has and does
/// not fit.
std::vector<Candidate> FindCandidates(const RobotDescription& robot);

/// The robot with the candidates as further uncertain parameters, after its own.
RobotDescription WithCandidates(RobotDescription robot, const std::vector<Candidate>& candidates);

/// Whitened errors of simulators of the robot with candidates: a column of physical parameters
/// each, a column of errors each, as WindowErrors::Whitened has it.
using WhitenedErrors = std::function<Eigen::MatrixXd(const Eigen::MatrixXd& physical)>;

/// Derivatives of the errors with respect to each candidate, per physical unit, rows x candidates:
/// central differences, or one-sided ones at a parameter's border. Zero for errors that do not
/// depend on it smoothly, and where a simulator fails.
/// @param physical of the robot's own parameters. Simulates two columns per candidate, and one
/// more.
Eigen::MatrixXd CandidateColumns(const WhitenedErrors& whitened, const Eigen::VectorXd& physical,
                                 const std::vector<Candidate>& candidates);

}  // namespace plumb
