#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "calibrator/design/excitation_signals.h"
#include "calibrator/diagnostics/identifiability.h"
#include "common/gaussian.h"
#include "robot/description.h"

namespace plumb {

// The functions here share nothing: thread-safe.

/// An excitation, the motion it makes and how much that would tell of the parameters.
struct RatedExcitation {
  Excitation excitation;  ///< scaled down until all simulators keep within the limits
  double gain;            ///< [nat], the least of the simulators drawn
  /// Fisher information of the coordinates, of the simulator that gains least
  Eigen::MatrixXd information;
  Eigen::VectorXd sd;  ///< of each coordinate that is to be expected then
  /// share of a range or velocity limit that is always left; 1 where there are no limits
  double margin;
  int steps;          ///< of control until the first simulator's episode ends
  Eigen::MatrixXd q;  ///< positions x (steps + 1), of the mean simulator
};

/// Which of the excitations that MakeExcitations makes tell most. The value of an experiment is its
/// information gain in the linear-Gaussian model,
///   1/2 ln det(I + L^T F L),
/// L L^T the belief's covariance, F the Fisher information of one-step errors
/// (D-optimality: Chaloner, Verdinelli, Statistical Science 10, 1995, eq. 5), with states as exact
/// as SmoothedNoise says. The motion is simulated from the state in which an episode of the task
/// with this seed begins, with the belief's mean and a few draws of it, until the task ends the
/// episode; the draw that tells least counts.
///
/// An excitation with which any of these simulators leaves a joint's position limits (less the
/// margin) or velocity limit is tried at half and at a quarter of its amplitude, and then left out.
/// Position limits do not count where the robot's simulator has their stops ([simulation.limit]):
/// then they are part of the motion.
/// @param belief over the parameters' coordinates: the prior, or a posterior.
/// @return best first, maybe none.
/// @throws std::invalid_argument if the robot has no parameters or motors.
std::vector<RatedExcitation> RateExcitations(const RobotDescription& robot, const Gaussian& belief,
                                             const ExcitationSettings& settings);

/// Where an excitation begins: (q, v) of the task's episode with this seed.
std::pair<Eigen::VectorXd, Eigen::VectorXd> ExcitationStart(const RobotDescription& robot,
                                                            uint64_t seed);

/// Standard deviations of parameters, physical units to first order, for those of the coordinates
/// around `mean`.
Eigen::VectorXd PhysicalSd(const RobotDescription& robot, const Eigen::VectorXd& mean,
                           const Eigen::VectorXd& sd);

/// "helps with mass/leg (sd 0.42 -> 0.013 kg) and ...; hardly with ...".
std::string DescribeGain(const RobotDescription& robot, const Gaussian& belief,
                         const RatedExcitation& rated);

/// The motion that would tell most about a posterior's weak directions, or about all parameters if
/// there are none.
struct MotionAdvice {
  /// best first, by what they tell of the weak directions; maybe none
  std::vector<RatedExcitation> rated;
  std::string summary;
};
MotionAdvice AdviseMotion(const RobotDescription& robot, const Gaussian& posterior,
                          const Identifiability& found, const ExcitationSettings& settings);

}  // namespace plumb
