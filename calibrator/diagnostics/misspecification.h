#pragma once

#include <Eigen/Core>
#include <span>
#include <string>
#include <vector>

#include "calibrator/diagnostics/candidates.h"
#include "calibrator/fit/window_errors.h"
#include "calibrator/motion/transitions.h"
#include "robot/description.h"

namespace plumb {

/// One way in which the model does not explain the robot.
struct Misfit {
  std::string what;       ///< "knee, at ground contact", for people
  std::string joint;      ///< empty = of all joints
  std::string condition;  ///< "contact", "free" or empty = both
  std::string test;       ///< "scale", "whiteness", "bias", "structure", "outliers"
  double statistic;       ///< of the test
  /// of such a statistic if the model were right, corrected for the number of tests
  double p;
  /// share of the errors' variance that it makes, 0 to 1; NaN where there is no such share
  double effect;
};

/// By how much a candidate would have to be larger to make the errors smallest, alone with the
/// fitted parameters.
struct CandidateChange {
  size_t candidate;  ///< index
  double change;     ///< physical units
  double gain;       ///< of the sum of squares, >= 0
};

/// Whether the model can explain the robot at all.
struct Misspecification {
  bool alarm = false;
  std::vector<Misfit> misfits;  ///< those that count, worst first
  std::string summary;
  std::vector<CandidateChange> changes{};  ///< of all candidates that can be tested, best first
  bool judged = true;                      ///< else nobody can tell, and the summary says why
};

/// A state, and the positions at a transition's end.
struct Whereabouts {
  Eigen::VectorXd q, v, next_q;
};

/// The errors that a fit has left, and what they are to be tested for.
struct FitResiduals {
  std::span<const Rollout> rollouts;        ///< that were fitted
  std::span<const WindowErrors::Row> rows;  ///< the coordinate and transition of each error
  /// one-step, whitened and divided by their estimated scale, at the posterior's mean: for the
  /// right model N(0, 1)
  Eigen::VectorXd errors;
  /// rows x d: of the errors with respect to what was fitted, in any units
  Eigen::MatrixXd jacobian;
  /// of each entry of (q, v): else the noise's scale was estimated
  std::vector<bool> noise_known;
  std::vector<Candidate> candidates;  ///< not fitted
  Eigen::MatrixXd columns;            ///< rows x candidates: CandidateColumns
  /// Of each transition that there are rows of, in order: where it is taken to have been, for what
  /// touches and for the regression. Empty: as recorded.
  std::vector<Whereabouts> where = {};
};

/// Whether the model can explain the robot at all, whatever its parameters.
///
/// Errors are first projected onto the orthogonal complement of the Jacobian, so that what other
/// values of the parameters (or the prior's pull on them) would explain does not count. Then, for
/// each joint and for transitions in contact and free ones apart where that makes sense:
///   scale      sum of squares, chi^2, where the noise is known; where it was estimated, whether
///              errors in contact are as large as free ones: Brown, Forsythe, JASA 69 (1974), on
///              absolute errors, with Welch's variances
///   outliers   more errors beyond 5 sd than a Gaussian has
///   whiteness  correlation of successive errors of an episode up to lag 6, gapless stretches only:
///              Ljung, Box, Biometrika 65 (1978), each lag normalised by the products' own
///              variance, which heteroscedastic errors need (Lobato, Nankervis, Savin, J. Am. Stat.
///              Assoc. 96, 2001). From lag 2 on where consecutive transitions share a noisy state,
///              which makes a legitimate correlation at lag 1.
///   bias       mean
///   structure  Rao's score test of each candidate: (c' r)^2 / (c' c) with c the candidate's column
///              projected like the errors (Rao, Proc. Camb. Phil. Soc. 44, 1948; Breusch, Pagan,
///              Rev. Econ. Stud. 47, 1980); and an F-test of a regression on 1, q, v, sin q, cos q,
///              u, |v| v and sign v of all joints.
/// In score tests and bias the variance is the larger one of the model's and of that which the
/// errors themselves show, transitions as clusters and neighbours correlated (White, Econometrica
/// 48, 1980; Newey, West, Econometrica 55, 1987): a knock at the robot does not pass for a
/// structure.
///
/// Where the noise is said to be known and the errors are significantly smaller than that, it is a
/// bound: it has room for the estimator's own errors, which do correlate and do depend on the
/// motion. Whiteness, bias and regression are not tested then.
///
/// There is an alarm if for any test p times the number of tests is below kFalseAlarm, and the
/// effect is not negligible: with enough data any model is wrong. Thresholds: kLeastShare of the
/// errors' variance for bias and structure, kLeastCorrelation for whiteness (smoothed states make
/// some), kLeastExcess for scale (noise is seldom known better), and of a joint's errors in a
/// condition kLeastOutliers must be outliers, those of two transitions that share a bad reading
/// counting as one's; fewer are told of without an alarm.
///
/// What is told: candidates that explain most, one after the other, each time with what is left;
/// then what none of them explains. Nearly as good candidates are named as alternatives.
/// Thread-safe.
///
/// @param robot with known parameters (Model::Describe), for what touches the ground.
/// @throws std::invalid_argument if sizes do not fit together.
Misspecification FindMisspecification(const RobotDescription& robot, const FitResiduals& residuals);

inline constexpr double kFalseAlarm = 1e-3;
inline constexpr double kLeastShare = 0.01;
inline constexpr double kLeastCorrelation = 0.05;
inline constexpr double kLeastExcess = 0.2;
inline constexpr double kLeastOutliers = 0.01;

}  // namespace plumb
