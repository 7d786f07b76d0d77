#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "calibrator/fit/streaming.h"
#include "calibrator/live/calibrator.h"
#include "calibrator/live/checkpoint.h"
#include "calibrator/live/simopt.h"
#include "common/clock.h"
#include "common/name_lock.h"
#include "plumb/calibration_status_t.hpp"
#include "plumb/parameter_distribution_t.hpp"
#include "robot/description.h"

namespace plumb {

/// The calibrator's part of SimOpt, the same for a live run and for a log: from the messages of
/// roll-outs, iteration by iteration, a distribution of simulators. After each update the state is
/// in its folder (CalibrationCheckpoint), after each iteration its posterior_<iteration>.json, and
/// a session that finds such a state there goes on from it to the same bits.
///
/// Does not know who sends or receives. Not thread-safe; SimOpt works with threads of its own.
class CalibrationSession {
 public:
  struct Settings {
    std::string folder = {};  ///< of checkpoints and posteriors; made if it is not there
    std::string method = {};  ///< of inference (SimOpt); empty = as the robot's [calibration] says
    uint64_t seed = 1;        ///< of the random numbers
    int threads = 0;          ///< 0 = one for each core; the result does not depend on it
    /// Whatever the folder holds: a run in virtual time begins anew, and comes to the same.
    bool anew = false;
  };

  /// @param robot, clock must outlive the session; by the clock it tells how long an iteration
  /// took.
  /// @throws std::invalid_argument if the method is none, or the folder's state is of another
  /// method, then naming the folder.
  /// @throws std::runtime_error if another process, or session, has the folder, or what it holds is
  /// damaged or another robot's or seed's.
  CalibrationSession(const RobotDescription& robot, const Settings& settings, const Clock& clock);

  /// Takes the messages of the robot's motion.
  Calibrator& calibrator() { return calibrator_; }

  /// There is an update to do.
  bool busy() const { return simopt_.running() || calibrator_.ready(); }
  /// Does one if so, beginning the next iteration where its roll-outs have arrived, and writes the
  /// state. @return true when that has completed an iteration: its posterior is written.
  /// @throws std::runtime_error naming the file if it cannot be written.
  bool Work();

  /// Takes account of what has arrived of a roll-out under way: for the status only, nothing that
  /// is learnt depends on it.
  void Stream();

  /// The distribution of the iteration completed last, or the prior.
  parameter_distribution_t Distribution() const;
  /// Progress and findings; `seconds` are real ones, of the last iteration of this process, 0
  /// before its first.
  calibration_status_t Status() const;

 private:
  void Resume(SimOpt::State state);
  void BeginIteration();
  void Warn(const CalibrationReport& report) const;
  void Assimilate(const Rollout& rollout);
  void WriteFindings() const;

  const RobotDescription& robot_;
  const Clock& clock_;
  std::filesystem::path folder_;
  int64_t start_;  // of the iteration under way, or of the session [us]
  const NameLock lock_;
  SimOpt simopt_;
  Calibrator calibrator_;
  CalibrationCheckpoint checkpoint_;
  std::optional<CalibrationReport> report_;  // of the iteration completed last
  std::optional<StreamingLaplace> stream_;
  int streamed_iteration_ = 0;
  double seconds_ = 0;  // that the last one took, real ones
};

}  // namespace plumb
