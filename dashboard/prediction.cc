#include "dashboard/prediction.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>

#include "common/message_json.h"
#include "common/time_units.h"
#include "robot/physical.h"

namespace plumb {
namespace {

constexpr size_t kMaxStates = 256;

Eigen::VectorXd ToEigen(const std::vector<double>& values) {
  return Eigen::VectorXd::Map(values.data(), static_cast<Eigen::Index>(values.size()));
}

void AppendList(const char* name, const Eigen::VectorXd& values, std::string& json) {
  json += fmt::format(R"(,"{}":[)", name);
  for (const double value : values) {
    if (json.back() != '[') json += ',';
    AppendJsonNumber(value, json);
  }
  json += ']';
}

}  // namespace

std::string OneStepPrediction::Predicted::Json() const {
  std::string json = fmt::format(R"({{"utime":{},"sequence":{})", utime, sequence);
  AppendList("q", q, json);
  AppendList("v", v, json);
  AppendList("q_measured", q_measured, json);
  return json + "}";
}

OneStepPrediction::OneStepPrediction(const RobotDescription& robot)
    : simulator_(robot), period_(Microseconds(robot.task.period)) {}

void OneStepPrediction::OnState(const robot_state_t& state) {
  State next{state.utime,      state.sequence,        ToEigen(state.q),
             ToEigen(state.v), ToEigen(state.effort), state.restarted != 0};
  const bool ours = IsTime(next.utime) && next.sequence >= 0 &&
                    next.sequence < std::numeric_limits<int64_t>::max() &&
                    next.q.size() == simulator_.num_positions() &&
                    next.v.size() == simulator_.num_velocities() && next.q.allFinite() &&
                    next.v.allFinite() && next.effort.size() == next.v.size();
  const bool follows = !states_.empty() && next.sequence == states_.back().sequence + 1 &&
                       next.utime > states_.back().utime &&
                       next.utime - states_.back().utime <= 10 * period_ && !next.restarted;
  if (!ours || !follows) states_.clear();
  if (!ours) return;
  states_.push_back(std::move(next));
  const int64_t oldest = states_.back().utime - 2 * period_;
  while (states_.size() > kMaxStates || states_.front().utime < oldest) states_.pop_front();
}

/// That acted from one state to another.
std::vector<EffortSegment> OneStepPrediction::Efforts(size_t from, size_t to) const {
  std::vector<EffortSegment> efforts;
  for (size_t i = from + 1; i <= to; ++i)
    efforts.push_back({Seconds(states_[i].utime - states_[i - 1].utime), states_[i].effort});
  return efforts;
}

std::optional<OneStepPrediction::Predicted> OneStepPrediction::Predict() {
  if (states_.size() < 2) return std::nullopt;
  const State& to = states_.back();
  const auto off = [&](const State& state) { return std::abs(to.utime - state.utime - period_); };
  const auto begin = std::ranges::min_element(states_, {}, off);
  if (off(*begin) > period_ / 5) return std::nullopt;
  const auto unknown = [](const State& state) { return !state.effort.allFinite(); };
  if (std::any_of(begin, states_.end(), unknown)) return std::nullopt;
  const auto from = static_cast<size_t>(begin - states_.begin());
  simulator_.SetReading(begin->q, begin->v, begin->effort);
  // Efforts may be on their way still.
  if (std::none_of(states_.begin(), begin, unknown)) simulator_.Recall(Efforts(0, from));
  simulator_.Step(Efforts(from, states_.size() - 1));
  if (!simulator_.finite()) return std::nullopt;
  const Simulator::State reading = simulator_.Reading();
  return Predicted{to.utime, to.sequence, reading.q, reading.v, to.q};
}

}  // namespace plumb
