#include "calibrator/motion/lcm_log.h"

#include <fmt/format.h>

#include <algorithm>
#include <deque>
#include <optional>
#include <stdexcept>
#include <utility>

#include "calibrator/motion/motion_log.h"
#include "calibrator/motion/recorded_robot.h"
#include "common/time_units.h"
#include "robot/physical.h"

namespace plumb {
namespace {

// [states] A message may be in the log that much later than one of another channel that came after
// it.
constexpr int64_t kPatience = 5000;
// Episodes under way at once: in a robot's log an episode has a state of its own at least.
constexpr size_t kMostEpisodes = kPatience;

/// Joins the episodes of a log one after the other as soon as each is complete, so that no more
/// than one or two need be remembered however long the log is.
class EpisodeJoiner {
 public:
  EpisodeJoiner(const RobotDescription& robot, std::vector<Rollout>* rollouts)
      : robot_(robot), rollouts_(*rollouts), joiner_(TransitionJoiner::Unbounded(robot)) {}

  void OnState(const robot_state_t& state) {
    if (!Fits(state.num_positions, robot_.num_positions(), "coordinates") ||
        !Fits(state.num_velocities, robot_.num_velocities(), "velocities") || state.sequence < 0 ||
        state.sequence > TransitionJoiner::kMaxSequence || !IsTime(state.utime))
      return;
    if (joiner_.BeginsRun(state)) BeginRun();
    joiner_.OnState(state);
    while (!episodes_.empty() && IsComplete(episodes_.front())) JoinFirst();
    int64_t needed = joiner_.newest_state() - kPatience;
    for (const Episode& episode : episodes_) needed = std::min(needed, episode.first_state);
    joiner_.Forget(needed);
  }

  void OnCommand(const joint_command_t& command) {
    if (!Fits(command.num_joints, robot_.num_joints(), "joints")) return;
    // It would make of its episode one that is never over, which those behind it wait for.
    if (!MayCome(command.state_sequence)) {
      ++implausible_;
      return;
    }
    // Whatever command comes next answers the state that the one before led to.
    for (Episode& episode : episodes_) {
      if (!episode.next_state && episode.id != command.episode)
        episode.next_state = command.state_sequence;
    }
    if (command.episode < 0) return;
    const auto found = std::find_if(episodes_.begin(), episodes_.end(),
                                    [&](const Episode& e) { return e.id == command.episode; });
    if (found == episodes_.end()) {
      episodes_.push_back(
          {command.episode, command.state_sequence, command.state_sequence, {}, {}});
    } else {
      found->first_state = std::min(found->first_state, command.state_sequence);
      found->last_command = std::max(found->last_command, command.state_sequence);
    }
    joiner_.OnCommand(command);
    for (; episodes_.size() > kMostEpisodes; ++cut_off_) JoinFirst();
  }

  void OnControllerStatus(const controller_status_t& status) {
    for (size_t i = 0; i < status.episode.size(); ++i) {
      for (Episode& episode : episodes_) {
        if (episode.id == status.episode[i] && MayCome(status.last_state_sequence[i]))
          episode.named_state = status.last_state_sequence[i];
      }
    }
  }

  /// No more will come.
  void Finish() {
    while (!episodes_.empty()) JoinFirst();
  }

  DropCounts drops() const {
    DropCounts sum = drops_of_earlier_runs_;
    return sum += joiner_.drops();
  }
  int64_t fitting() const { return fitting_; }
  /// Messages of a robot with another number of joints, coordinates or velocities; of the newest
  /// its number and ours.
  int64_t foreign() const { return foreign_; }
  struct Numbers {
    int its, ours;
    const char* of_what;
  };
  const Numbers& foreign_numbers() const { return foreign_numbers_; }
  /// Episodes that were not over when too many others were under way.
  int64_t cut_off() const { return cut_off_; }
  /// Commands that answer a state which no robot has been in.
  int64_t implausible() const { return implausible_; }

 private:
  struct Episode {
    int64_t id;
    int64_t first_state, last_command;   // states that its first and last command answer
    std::optional<int64_t> next_state;   // that the command after it answers
    std::optional<int64_t> named_state;  // that ended it, says CONTROLLER_STATUS
  };

  bool Fits(int entries, int ours, const char* of_what) {
    if (entries == ours) return ++fitting_, true;
    ++foreign_;
    foreign_numbers_ = {entries, ours, of_what};
    return false;
  }

  // Whether a state is there, or may still come. Nothing is known of a log's first ones.
  bool MayCome(int64_t state) const {
    const int64_t newest = joiner_.newest_state();
    return state >= 0 &&
           state <= (newest < 0 ? TransitionJoiner::kMaxSequence : newest + kPatience);
  }

  // A restarted driver counts its states from 0 again. What is under way gets no further.
  void BeginRun() {
    Finish();
    drops_of_earlier_runs_ = drops();
    joiner_ = TransitionJoiner::Unbounded(robot_);
  }

  bool IsComplete(const Episode& episode) const {
    if (episode.named_state) return joiner_.newest_state() >= *episode.named_state;
    return joiner_.newest_state() - kPatience >=
           std::max(episode.last_command, episode.next_state.value_or(0));
  }

  int64_t LastState(const Episode& episode) const {
    if (episode.named_state) return *episode.named_state;
    if (episode.next_state) return *episode.next_state;
    const robot_state_t* from = joiner_.FindState(episode.last_command);
    if (!from) return episode.last_command;
    const double period = robot_.task.period + robot_.driver.measurement / 2;
    const int64_t until = from->utime + Microseconds(period);
    int64_t last = episode.last_command;
    for (const robot_state_t* next; (next = joiner_.FindState(last + 1)) && next->utime <= until;)
      ++last;
    return last;
  }

  void JoinFirst() {
    const Episode episode = episodes_.front();
    episodes_.pop_front();
    Rollout rollout = joiner_.Join(episode.id, LastState(episode));
    if (!rollout.transitions.empty()) rollouts_.push_back(std::move(rollout));
  }

  const RobotDescription& robot_;
  std::vector<Rollout>& rollouts_;
  TransitionJoiner joiner_;
  std::deque<Episode> episodes_;  // not joined yet, in the order in which they began
  DropCounts drops_of_earlier_runs_;
  int64_t fitting_ = 0, foreign_ = 0;
  Numbers foreign_numbers_{};
  int64_t cut_off_ = 0, implausible_ = 0;
};

// Estimates at another rate, and messages that were lost, are told apart: most drops are of a kind.
std::string WhyDropped(const DropCounts& drops, double period) {
  if (2 * drops.late > drops.total()) {
    return fmt::format(
        "its commands answer states {:.6g} s apart, but the task's control period is {:.6g} s",
        drops.late_interval, period);
  }
  const bool lost = 2 * drops.gap > drops.total();
  return (lost ? "states or commands are missing: " : "") + drops.summary();
}

}  // namespace

Log ReadLcmLog(const std::string& file, const RobotDescription& robot) {
  Log log{file, {}, {}, CheckRecordedRobot(file, robot)};
  EpisodeJoiner joiner(robot, &log.rollouts);
  const MotionCounts counts = ReadMotion(file, joiner, [] { return true; });
  joiner.Finish();
  log.drops = joiner.drops();
  if (counts.undecodable > 0) {
    log.warnings.push_back(fmt::format("{} messages do not decode", counts.undecodable));
  }
  if (joiner.cut_off() > 0) {
    log.warnings.push_back(fmt::format("{} episodes never end: more than {} are under way at once",
                                       joiner.cut_off(), kMostEpisodes));
  }
  if (joiner.implausible() > 0) {
    log.warnings.push_back(
        fmt::format("{} commands answer states that the robot was never in", joiner.implausible()));
  }
  if (joiner.foreign() > 0) {
    const auto& [its, ours, of_what] = joiner.foreign_numbers();
    log.warnings.push_back(fmt::format("{} messages are of a robot with {} {}, '{}' has {}",
                                       joiner.foreign(), its, of_what, robot.name, ours));
  }
  if (!log.rollouts.empty()) {
    if (counts.cut_off) log.warnings.push_back("its last message is cut off");
    return log;
  }
  if (log.drops.model_based > 0) {
    throw std::runtime_error(
        file +
        ": its states are model-based: calibration would find the parameters that the estimator "
        "assumed. ROBOT_STATE_SMOOTHED has to be a kinematic estimator's");
  }
  std::string why;
  if (counts.events == 0) {
    why = counts.cut_off ? "its first message is cut off" : "it is empty";
  } else if (counts.messages == 0) {
    why = fmt::format(
        "none of its {} messages is a ROBOT_STATE_SMOOTHED, JOINT_COMMAND or CONTROLLER_STATUS",
        counts.events);
  } else if (joiner.fitting() == 0 && joiner.foreign() + counts.undecodable > 0) {
    why = log.warnings.back();
  } else if (log.drops.total() == 0) {
    why = "it holds no command of an episode";
  } else {
    why = WhyDropped(log.drops, robot.task.period);
  }
  if (counts.events > 0 && counts.cut_off) why += "; its last message is cut off";
  throw std::runtime_error(file + ": no transition can be used: " + why);
}

}  // namespace plumb
