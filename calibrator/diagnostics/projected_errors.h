#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "calibrator/diagnostics/misspecification.h"

namespace plumb {

// The functions here share nothing, and const errors may be read by several threads at once.

/// Errors that no other values of the fitted parameters would explain, sorted by what they are
/// about.
struct ProjectedErrors {
  /// @param robot with known parameters. @throws std::invalid_argument if sizes do not fit
  /// together.
  ProjectedErrors(const RobotDescription& robot, const FitResiduals& residuals);

  /// As if the parameter with this (projected) column had been fitted, too.
  void Explain(const Eigen::VectorXd& column);

  Eigen::VectorXd Project(const Eigen::VectorXd& x) const {
    return x - basis * (basis.transpose() * x);
  }

  Eigen::Index n = 0;  ///< velocities
  Eigen::VectorXd r;   ///< rows, weighted
  /// Of each row: 1, but for outliers, which count as if they were kOutlier robust sd of their kind
  /// large. All columns that meet r have to be weighted, too.
  Eigen::VectorXd weight;
  Eigen::VectorXd freedom;  ///< of each row: 1 - its leverage
  Eigen::MatrixXd basis;    ///< of the Jacobian's range, orthonormal
  struct Step {
    const Transition* transition;
    Eigen::VectorXd q, v;  ///< where it is taken to begin
    bool contact;
    int next;           ///< index of the step that goes on from this one's end, -1 if there is none
    bool shares_state;  ///< and begins with the same noisy reading
    std::vector<Eigen::Index> rows;  ///< of each coordinate, -1 where it was not observed
  };
  std::vector<Step> steps;      ///< transitions, in order
  std::vector<int> step_of;     ///< of each row
  std::vector<int> coordinate;  ///< of each row
  /// of each row: beyond kOutlier robust sd of its coordinate and condition
  std::vector<bool> outlying;
  /// Of each row: outlying, and so was the joint in the step before, which ended with the reading
  /// that this one begins with: a bad reading spoils both, and counts once. Of a run of outlying
  /// steps every second one is repeated.
  std::vector<bool> repeated;
  /// Of each coordinate: its noise is said to be known, and the errors are significantly smaller
  /// than that.
  std::vector<bool> quiet;
  /// fewer than kLeastOutliers of all rows: the other tests leave them out
  bool few_outliers = false;
  std::vector<std::string> joint_of;  ///< of each velocity
  std::string contact_words;          ///< "at ground contact", "at a stop", ...
  /// there are enough transitions in contact and free to tell them apart
  bool conditions = false;

  bool Contact(Eigen::Index row) const {
    return steps[static_cast<size_t>(step_of[static_cast<size_t>(row)])].contact;
  }
  bool Out(Eigen::Index row) const { return few_outliers && outlying[static_cast<size_t>(row)]; }
  /// "knee, at ground contact". @param condition "contact", "free" or empty.
  std::string Place(const std::string& joint, const std::string& condition) const;

 private:
  std::vector<bool> noise_known_;
  void Weigh(const Eigen::VectorXd& errors);
  void FindRepeated();
  void Take(const Eigen::VectorXd& weighted);
};

inline constexpr double kOutlier = 5;

/// One direction in which errors may lie: Rao's score test with a variance that errors' own may
/// enlarge.
struct Score {
  double statistic = 0;  ///< chi^2 of one degree of freedom
  double p = 1;          ///< not corrected
  /// -c' r / (c' c + 1 / scale^2): by how much the parameter would have to be larger
  double change = 0;
  double gain = 0;  ///< by how much that would reduce the sum of squares
};
/// @param column projected. @param scale of likely changes, infinite for no opinion. @param lower
/// least change.
Score FindScore(const ProjectedErrors& errors, const Eigen::VectorXd& column, double scale,
                double lower);

}  // namespace plumb
