#include "calibrator/fit/recorded_window.h"

#include <cmath>

#include "common/special_numbers.h"

namespace plumb {

size_t StretchLength(const Rollout& rollout, size_t first) {
  const auto& t = rollout.transitions;
  const auto disturbed = [&](size_t i) { return t[i].disturbance.cols() > 0; };
  size_t end = first + 1;
  while (end < t.size() && t[end].step == t[end - 1].step + 1 && !disturbed(end - 1) &&
         !disturbed(end))
    ++end;
  return end - first;
}

bool IsObserved(const Transition& t) {
  return t.next_q.array().isFinite().any() || t.next_v.array().isFinite().any();
}

bool IsJudged(const Rollout& rollout, size_t first, size_t length) {
  const auto& t = rollout.transitions;
  const size_t last = first + length - 1;
  return last < t.size() && t[last].step == t[first].step + static_cast<int>(length) - 1 &&
         IsObserved(t[last]);
}

bool IsUnread(const Transition& t, Eigen::Index c) {
  return t.v_sd(c) > 0 && std::isnan(t.next_v(c));
}

int ShortestWindow(std::span<const Rollout> rollouts) {
  for (const Rollout& rollout : rollouts) {
    for (const Transition& t : rollout.transitions) {
      for (Eigen::Index c = 0; c < t.v.size(); ++c)
        if (IsUnread(t, c)) return kUnreadVelocityWindow;
    }
  }
  return 1;
}

Window RecordedWindow(const Model& model, const Rollout& rollout, size_t first, size_t length) {
  const auto& t = rollout.transitions;
  Window window{t[first].q, t[first].v, {}};
  for (size_t i = first; i < first + length; ++i) window.steps.emplace_back(t[i].efforts);
  if (!model.parameters().delays()) return window;
  double known = 0;
  for (size_t i = first; i > 0 && known < JointDynamics::kLongestDelay; --i) {
    if (t[i - 1].step != t[i].step - 1) break;
    window.before.insert(window.before.begin(), t[i - 1].efforts);
    known += t[i - 1].duration();
  }
  return window;
}

void BeginTransition(const Rollout& rollout, size_t i, Simulator* simulator) {
  const Window window = RecordedWindow(simulator->model(), rollout, i, 1);
  std::vector<EffortSegment> before;
  for (const auto& step : window.before) before.insert(before.end(), step.begin(), step.end());
  simulator->SetReading(window.q, window.v, before, window.steps.front().front().effort);
}

double EndError(const ConfigurationSpace& space, const Eigen::VectorXd& q, const Eigen::VectorXd& v,
                const Transition& t, Eigen::Index c) {
  const Eigen::Index n = t.next_v.size();
  return c < n ? space.Difference(q, t.next_q, c) : v(c - n) - t.next_v(c - n);
}

double EndSd(const Transition& t, Eigen::Index c) {
  return c < t.next_q_sd.size() ? t.next_q_sd(c) : t.next_v_sd(c - t.next_q_sd.size());
}

double EndSd(const Transition& t, Eigen::Index c, const Eigen::VectorXd& noise_sd) {
  const double sd = EndSd(t, c);
  return sd > 0 ? sd : noise_sd(c);
}

const Eigen::VectorXd& NearEnd(const Transition& t) {
  return t.next_q.allFinite() ? t.next_q : t.q;
}

bool IsObserved(const ConfigurationSpace& space, const Transition& t, Eigen::Index c) {
  const Eigen::Index n = t.next_v.size();
  return std::isfinite(c < n ? space.Difference(t.next_q, t.next_q, c) : t.next_v(c - n));
}

double MeanSquaredError(const ConfigurationSpace& space, const Eigen::Ref<const Eigen::VectorXd>& q,
                        const Eigen::Ref<const Eigen::VectorXd>& v, const Transition& t,
                        const Eigen::VectorXd& scale) {
  Eigen::ArrayXd error(scale.size()), recorded(scale.size());  // NaN where it is not
  error << space.Difference(q, t.next_q), v - t.next_v;
  recorded << space.Difference(t.next_q, t.next_q), t.next_v;
  const auto observed = recorded.isFinite();
  const double mean = observed.select((error / scale.array()).square(), 0.0).sum() /
                      static_cast<double>(observed.count());
  return std::isfinite(mean) ? mean : kInfinity;
}

void MoveStart(const ConfigurationSpace& space, Eigen::Index c, double by, Window* window) {
  const Eigen::Index n = window->v.size();
  if (c < n)
    space.Move(c, by, window->q);
  else
    window->v(c - n) += by;
}

Eigen::VectorXd StartSd(const Transition& t) {
  Eigen::VectorXd sd(t.q_sd.size() + t.v_sd.size());
  sd << t.q_sd, t.v_sd;
  return sd;
}

Eigen::VectorXd StartSd(const Transition& t, const Eigen::VectorXd& noise_sd) {
  const Eigen::VectorXd sd = StartSd(t);
  return sd.array().isNaN().select(noise_sd, sd);
}

void AddDisturbance(const Transition& t, std::span<const int> coordinates,
                    Eigen::VectorXd* start_sd, Eigen::MatrixXd* sensitivity) {
  const Eigen::Index added = t.disturbance.cols(), before = sensitivity->cols(),
                     rows = static_cast<Eigen::Index>(coordinates.size());
  if (added == 0) return;
  start_sd->conservativeResize(before + added);
  start_sd->tail(added).setOnes();
  sensitivity->conservativeResize(rows, before + added);
  for (Eigen::Index i = 0; i < rows; ++i)
    sensitivity->row(i).tail(added) = t.disturbance.row(coordinates[static_cast<size_t>(i)]);
}

}  // namespace plumb
