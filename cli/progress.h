#pragma once

#include <Eigen/Core>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "plumb/calibration_status_t.hpp"
#include "plumb/controller_status_t.hpp"
#include "plumb/driver_status_t.hpp"
#include "plumb/training_status_t.hpp"
#include "robot/description.h"

namespace plumb {

/// The progress of a run, gathered from the status messages, for the live line, the table and the
/// summary. Time is an argument. Not thread-safe.
class Progress {
 public:
  /// @param calibrates_only the run ends with the last calibration; else with the final policy's
  /// evaluation.
  Progress(const RobotDescription& robot, int iterations, bool calibrates_only = false)
      : robot_(robot), iterations_(iterations), calibrates_only_(calibrates_only) {
    training_.incumbent = training_.incumbent_since = training_.challenger = -1;
  }

  void OnDriver(const driver_status_t& status);
  void OnController(const controller_status_t& status);
  void OnCalibration(const calibration_status_t& status);
  void OnTraining(const training_status_t& status);
  /// Attributes the time since the last call to what the loop is waiting for.
  /// @param seconds by the run's clock since its start. @param real_seconds since then.
  void Account(double seconds, double real_seconds);

  const driver_status_t& driver() const { return driver_; }
  const controller_status_t& controller() const { return controller_; }
  /// Table rows that have become complete since the last call, and below them what has been decided
  /// on the policies that they rest on.
  std::vector<std::string> TakeRows();
  std::string Header() const;
  std::string StatusLine(double seconds) const;
  /// True when the final policy's evaluation roll-outs, or the last calibration, are done.
  bool finished() const { return finished_; }

  /// "learned beside the hidden truth", for people. @param truth physical; empty if nobody knows.
  std::string Conclusion(const Eigen::VectorXd& truth) const;
  /// The same for programs; see docs/summary.md.
  nlohmann::json Summary(const Eigen::VectorXd& truth) const;

 private:
  struct Iteration {
    calibration_status_t calibration;
    double simulated_return, robot_return, seconds;
  };
  struct Decision {
    std::string text;
    bool accepted;
    double probability, challenger_return, incumbent_return;
  };
  std::string Why() const;
  std::string Row(const Iteration& iteration) const;
  /// The true value of an iteration's determined combination: which there are, and in which order,
  /// is each iteration's.
  double TrueCombination(const calibration_status_t& c, size_t index,
                         const Eigen::VectorXd& truth) const;
  nlohmann::json Summarise(const Iteration& iteration, const Eigen::VectorXd& truth) const;
  nlohmann::json SummariseDecisions() const;

  const RobotDescription& robot_;
  int iterations_;
  bool calibrates_only_;
  driver_status_t driver_{};
  controller_status_t controller_{};
  training_status_t training_{};
  std::map<int, double> simulated_return_, robot_return_;  // by policy iteration
  std::vector<Iteration> done_;
  size_t taken_ = 0;
  std::map<int, Decision> decisions_;  // by challenger
  std::vector<std::string> decided_;   // to be taken
  std::vector<double> evaluation_;
  bool finished_ = false;
  /// [s] spent on what, by one clock.
  struct Spent {
    double& Doing(const controller_status_t& controller, const training_status_t& training);
    void Account(double now, const controller_status_t& controller,
                 const training_status_t& training);
    double robot = 0, training = 0, other = 0;
    double accounted = 0;  // up to when
  };
  Spent spent_, really_spent_;  // by the run's clock; in real time
  double last_row_ = 0;
};

}  // namespace plumb
