#include "calibrator/motion/transitions.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "common/time_units.h"
#include "robot/physical.h"

namespace plumb {
namespace {

constexpr size_t kMaxEpisodes = 64;
constexpr size_t kMaxCommands = 200'000;
constexpr int kMaxSteps = 1'000'000;
// [states] Within a channel messages keep their order but for a few: further back is another run.
constexpr int64_t kReordered = 1000;

Eigen::VectorXd ToEigen(const std::vector<double>& values) {
  return Eigen::VectorXd::Map(values.data(), static_cast<Eigen::Index>(values.size()));
}

// Where a staircase of efforts steps once, within a measurement's interval, its mean tells when:
// with e0 before and e1 after, after the share (e1 - mean) / (e1 - e0). The step is put back there.
// Left as its mean, it would move a joint wrongly by up to a / 8 T^2, a the step of the
// acceleration and T the interval: 1.6 % of what a command does in four intervals. Where there are
// more steps, or none, nothing is changed.
// @param before effort of the interval before the first segment.
void RestoreStep(const Eigen::VectorXd& before, std::vector<EffortSegment>* segments) {
  constexpr double kSame = 1e-9;  // of an effort: rounding of a mean
  Eigen::Index joint;
  const Eigen::VectorXd after = segments->back().effort;
  const double step = (after - before).cwiseAbs().maxCoeff(&joint);
  const double same = kSame * (1 + before.cwiseAbs().maxCoeff() + after.cwiseAbs().maxCoeff());
  if (!(step > same)) return;
  const auto is = [&](const EffortSegment& segment, const Eigen::VectorXd& effort) {
    return (segment.effort - effort).cwiseAbs().maxCoeff() <= same;
  };
  auto mixed = segments->begin();
  while (mixed != segments->end() && is(*mixed, before)) ++mixed;
  if (mixed == segments->end() || is(*mixed, after)) return;  // it steps where an interval begins
  for (auto later = mixed + 1; later != segments->end(); ++later) {
    if (!is(*later, after)) return;
  }
  if (mixed + 1 == segments->end()) return;  // what comes after it is not known
  const double share = (after(joint) - mixed->effort(joint)) / (after(joint) - before(joint));
  if (!(share > kSame && share < 1 - kSame)) return;
  const EffortSegment rest{(1 - share) * mixed->duration,
                           (mixed->effort - share * before) / (1 - share)};
  *mixed = {share * mixed->duration, before};
  segments->insert(mixed + 1, rest);
}

}  // namespace

size_t CountTransitions(std::span<const Rollout> rollouts) {
  size_t count = 0;
  for (const Rollout& rollout : rollouts) count += rollout.transitions.size();
  return count;
}

double Transition::duration() const {
  return std::accumulate(
      efforts.begin(), efforts.end(), 0.0,
      [](double sum, const EffortSegment& segment) { return sum + segment.duration; });
}

Eigen::VectorXd Transition::mean_effort() const {
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(efforts.front().effort.size());
  for (const EffortSegment& segment : efforts) sum += segment.duration * segment.effort;
  return sum / duration();
}

std::string DropCounts::summary() const {
  std::string summary = fmt::format("{} gap{}, {} late, {} not finite, {} across restarts", gap,
                                    gap == 1 ? "" : "s", late, not_finite, restart);
  if (model_based > 0) summary += fmt::format(", {} model-based", model_based);
  return summary;
}

DropCounts& DropCounts::operator+=(const DropCounts& other) {
  if (other.late > 0) late_interval = other.late_interval;
  gap += other.gap, late += other.late, not_finite += other.not_finite, restart += other.restart;
  model_based += other.model_based;
  return *this;
}

TransitionJoiner::TransitionJoiner(const RobotDescription& robot)
    : num_joints_(robot.num_joints()),
      space_(robot),
      period_(robot.task.period),
      greatest_effort_(GreatestEffort(robot)),
      max_states_(kMaxStates),
      max_episodes_(kMaxEpisodes),
      max_commands_(kMaxCommands) {}

TransitionJoiner TransitionJoiner::Unbounded(const RobotDescription& robot) {
  TransitionJoiner joiner(robot);
  joiner.max_states_ = joiner.max_episodes_ = joiner.max_commands_ =
      std::numeric_limits<size_t>::max();
  return joiner;
}

const robot_state_t* TransitionJoiner::FindState(int64_t sequence) const {
  const auto found = states_.find(sequence);
  return found == states_.end() ? nullptr : &found->second;
}

// Its clock may have been set back: then it is too far behind for a delay to explain it, or
// numbered among what is remembered and earlier than all of it.
bool TransitionJoiner::BeginsRun(const robot_state_t& smoothed) const {
  if (states_.empty()) return false;
  const auto& [first, oldest] = *states_.begin();
  const auto& [last, newest] = *states_.rbegin();
  if (smoothed.sequence < last - kReordered) return true;
  return smoothed.sequence <= last &&
         (smoothed.utime > newest.utime ||
          (smoothed.sequence >= first && smoothed.utime < oldest.utime));
}

void TransitionJoiner::OnState(const robot_state_t& smoothed) {
  if (smoothed.num_positions != space_.num_positions() ||
      smoothed.num_velocities != space_.num_velocities())
    return;
  if (smoothed.sequence < 0 || smoothed.sequence > kMaxSequence || !IsTime(smoothed.utime)) return;
  if (BeginsRun(smoothed)) {  // what was before cannot be joined with it
    cut_off_.clear();
    for (const auto& [id, episode] : episodes_) cut_off_.insert(id);
    states_.clear();
    episodes_.clear();
    num_commands_ = 0;
  }
  robot_state_t& state = states_.insert_or_assign(smoothed.sequence, smoothed).first->second;
  // Nobody asks for them, and a forged message may have a million.
  state.num_contacts = 0;
  std::vector<int8_t>().swap(state.contact);
  if (states_.size() > max_states_) states_.erase(states_.begin());
}

void TransitionJoiner::OnCommand(const joint_command_t& command) {
  if (command.num_joints != num_joints_ || command.episode < 0 || command.step < 0 ||
      command.step >= kMaxSteps)
    return;
  Episode& episode = episodes_.try_emplace(command.episode).first->second;
  if (episode.answer.empty()) episode.number = num_episodes_++;
  const bool is_new =
      episode.answer
          .insert_or_assign(command.step, Answer{command.state_sequence, command.policy_iteration})
          .second;
  if (is_new) ++num_commands_;
  if (episodes_.size() > max_episodes_) ForgetFirstEpisode();
  if (num_commands_ <= max_commands_) return;
  if (episodes_.size() > 1) return ForgetFirstEpisode();
  episode.answer.erase(episode.answer.begin());
  --num_commands_;
}

void TransitionJoiner::ForgetEpisode(Episodes::iterator episode) {
  num_commands_ -= episode->second.answer.size();
  episodes_.erase(episode);
}

// Not that of the least id: ids are times, which a clock that is set back begins anew.
void TransitionJoiner::ForgetFirstEpisode() {
  ForgetEpisode(std::ranges::min_element(
      episodes_, {}, [](const auto& episode) { return episode.second.number; }));
}

Rollout TransitionJoiner::Join(int64_t episode, int64_t last_state) {
  Rollout rollout;
  rollout.episode = episode;
  const auto found = episodes_.find(episode);
  if (found == episodes_.end()) return rollout;
  const std::map<int, Answer>& answers = found->second.answer;
  for (auto answer = answers.begin(); answer != answers.end(); ++answer) {
    rollout.policy_iteration = answer->second.policy_iteration;
    const auto next = std::next(answer);
    if (next != answers.end() && next->first != answer->first + 1) {
      ++drops_.gap;
      continue;
    }
    Transition transition;
    transition.step = answer->first;
    const int64_t to = next != answers.end() ? next->second.state_sequence : last_state;
    if (JoinOne(answer->second.state_sequence, to, &transition, &drops_))
      rollout.transitions.push_back(std::move(transition));
  }
  ForgetEpisode(found);
  return rollout;
}

std::vector<Transition> TransitionJoiner::TakeArrived(int64_t episode) {
  std::vector<Transition> arrived;
  const auto found = episodes_.find(episode);
  if (found == episodes_.end()) return arrived;
  DropCounts uncounted;
  auto& [number, next_taken, answers] = found->second;
  for (auto answer = answers.lower_bound(next_taken); answer != answers.end(); ++answer) {
    const auto next = std::next(answer);
    if (next == answers.end() || newest_state() < next->second.state_sequence) break;
    next_taken = next->first;
    Transition transition;
    transition.step = answer->first;
    const bool follows = next->first == answer->first + 1;
    if (follows && JoinOne(answer->second.state_sequence, next->second.state_sequence, &transition,
                           &uncounted)) {
      arrived.push_back(std::move(transition));
    }
  }
  return arrived;
}

bool TransitionJoiner::JoinOne(int64_t from, int64_t to, Transition* transition,
                               DropCounts* drops) const {
  const auto first = states_.find(from), last = states_.find(to);
  if (first == states_.end() || last == states_.end() || to <= from) {
    ++drops->gap;
    return false;
  }
  const double duration = Seconds(last->second.utime - first->second.utime);
  if (!(std::abs(duration - period_) <= kPeriodTolerance * period_)) {
    ++drops->late, drops->late_interval = duration;
    return false;
  }
  bool physical = true;
  int64_t expected = from;
  for (auto state = first; expected <= to; ++state, ++expected) {
    if (state == states_.end() || state->first != expected) {
      ++drops->gap;
      return false;
    }
    const robot_state_t& now = state->second;
    if (now.model_based) {
      ++drops->model_based;
      return false;
    }
    if (expected == from) continue;
    const robot_state_t& before = std::prev(state)->second;
    if (now.restarted) {
      ++drops->restart;
      return false;
    }
    EffortSegment segment{Seconds(now.utime - before.utime), ToEigen(now.effort)};
    physical = physical && segment.duration > 0 &&
               (segment.effort.array().abs() <= greatest_effort_).all();
    transition->efforts.push_back(std::move(segment));
  }
  const robot_state_t& s = first->second;
  const robot_state_t& t = last->second;
  transition->q = ToEigen(s.q), transition->v = ToEigen(s.v);
  transition->next_q = ToEigen(t.q), transition->next_v = ToEigen(t.v);
  transition->q_sd = ToEigen(s.q_sd), transition->v_sd = ToEigen(s.v_sd);
  transition->next_q_sd = ToEigen(t.q_sd), transition->next_v_sd = ToEigen(t.v_sd);
  for (const Eigen::VectorXd* x :
       {&transition->q, &transition->v, &transition->next_q, &transition->next_v})
    physical = physical && std::all_of(x->begin(), x->end(), IsPhysical);
  physical = physical && space_.Has(transition->q) && space_.Has(transition->next_q);
  for (const Eigen::VectorXd* sd :
       {&transition->q_sd, &transition->v_sd, &transition->next_q_sd, &transition->next_v_sd})
    physical = physical && std::all_of(sd->begin(), sd->end(), IsPhysicalSd);
  if (!physical) {
    ++drops->not_finite;
    return false;
  }
  if (const Eigen::VectorXd before = ToEigen(s.effort);
      (before.array().abs() <= greatest_effort_).all())
    RestoreStep(before, &transition->efforts);
  return true;
}

}  // namespace plumb
