#include "sim/environment.h"

#include <algorithm>
#include <span>
#include <stdexcept>
#include <utility>

#include "common/special_numbers.h"

namespace plumb {

Environment::Environment(const RobotDescription& description)
    : Environment(std::make_shared<Model>(description)) {}

Environment::Environment(const std::shared_ptr<const Model>& model)
    : task_(MakeTask(model->description())),
      model_(model),
      simulator_(model),
      steps_per_episode_(model->description().task.steps),
      period_(model->description().task.period),
      latency_(std::clamp(model->description().simulation.latency, 0.0, period_)),
      parts_{{period_, true}},
      start_q_(Eigen::VectorXd::Zero(model->num_positions())),
      start_v_(Eigen::VectorXd::Zero(model->num_velocities())),
      effort_(start_v_),
      next_effort_(start_v_),
      profile_{{{latency_, start_v_}, {period_ - latency_, start_v_}}},
      sent_(start_v_),
      mean_effort_(start_v_),
      mean_effort_before_(start_v_),
      reading_q_(simulator_.q()),
      reading_v_(simulator_.v()) {}

void Environment::SendThroughDriver() {
  const RobotDescription& robot = model_->description();
  constexpr double kNothing = 1e-9;  // [s] that rounding leaves
  parts_.clear();
  for (const bool late : {false, true}) {
    double left = late ? period_ - latency_ : latency_;
    while (left > kNothing) {
      const double cycle = left - robot.driver.cycle > kNothing ? robot.driver.cycle : left;
      parts_.push_back({cycle, late});
      left -= cycle;
    }
  }
  drives_.clear();
  for (const int i : robot.driven()) {
    drives_.push_back({robot.position_of(i), robot.velocity_of(i),
                       LimitsOf(robot.joints[static_cast<size_t>(i)])});
  }
}

void Environment::SetResidual(std::shared_ptr<const Residual> residual, size_t draw) {
  corrected_ = residual != nullptr;
  if (!corrected_) return;
  if (!correction_ || residual != correction_->residual())
    correction_ = std::make_unique<Correction>(*model_, std::move(residual));
  if (draw >= correction_->residual()->coordinates.size())
    throw std::invalid_argument("the residual has no such draw");
  draw_ = draw;
}

void Environment::Reset(Random& random) {
  if (corrected_) correction_->Begin(draw_, random);
  task_->InitialState(random, start_q_, start_v_);
  SetState(start_q_, start_v_);
}

void Environment::SetState(const Eigen::Ref<const Eigen::VectorXd>& q,
                           const Eigen::Ref<const Eigen::VectorXd>& v) {
  simulator_.SetState(q, v);
  effort_.setZero();
  sent_.setZero();
  sent_for_ = parts_.back().duration;
  mean_effort_before_.setZero();
  Read();
}

StepResult Environment::Step(const Eigen::Ref<const Eigen::VectorXf>& action) {
  Begin(action);
  for (const Part& part : parts_) {
    Send(part);
    simulator_.Run();
  }
  return End();
}

void Environment::Step(std::span<Move> moves, SimulatorLanes& lanes) {
  if (moves.empty()) return;
  for (const Move& move : moves) move.environment->Begin(move.action);
  for (size_t part = 0; part < moves[0].environment->parts_.size(); ++part) {
    for (const Move& move : moves) {
      move.environment->Send(move.environment->parts_[part]);
      lanes.Add(move.environment->simulator_);
    }
    lanes.Run();
  }
  for (Move& move : moves) move.result = move.environment->End();
}

void Environment::Begin(const Eigen::Ref<const Eigen::VectorXf>& action) {
  task_->Effort(std::span(action.data(), static_cast<size_t>(action.size())), next_effort_);
  start_q_ = q();
  start_v_ = v();
  if (!corrected_) return;
  correction_->BeginStep(simulator_);
  mean_effort_.setZero();
}

// Without a driver as a recorded step with these efforts is simulated, in the same substeps: a log
// of this environment is its model's to the last bit.
void Environment::Send(const Part& part) {
  if (!drives_.empty()) {
    const Eigen::VectorXd& wish = part.late ? next_effort_ : effort_;
    for (const Drive& drive : drives_) {
      double& sent = sent_[drive.velocity];
      const JointSituation joint{q()[drive.position], v()[drive.velocity], sent, sent_for_};
      sent = LimitEffort(wish[drive.velocity], joint, drive.limits).value_or(0);
    }
    sent_for_ = part.duration;
    simulator_.Prepare(sent_, part.duration);
    if (corrected_) mean_effort_ += part.duration / period_ * sent_;
    return;
  }
  profile_[0].effort = effort_, profile_[1].effort = next_effort_;
  if (latency_ > 0)
    simulator_.Prepare(profile_);
  else
    simulator_.Prepare(next_effort_, part.duration);
  if (!corrected_) return;
  for (const EffortSegment& segment : profile_)
    mean_effort_ += segment.duration / period_ * segment.effort;
}

StepResult Environment::End() {
  effort_.swap(next_effort_);
  if (corrected_) {
    correction_->EndStep(simulator_, mean_effort_, mean_effort_before_, period_);
    mean_effort_before_.swap(mean_effort_);
  }
  Read();
  if (!simulator_.finite()) return {kNaN, true};
  return {task_->Reward(start_q_, start_v_, effort_, q(), v()), task_->Terminated(q(), v())};
}

void Environment::Read() {
  const Simulator::State reading = simulator_.Reading();
  reading_q_ = reading.q;
  reading_v_ = reading.v;
}

void Environment::Observe(Eigen::Ref<Eigen::VectorXf> observation) const {
  task_->Observe(reading_q_, reading_v_,
                 std::span(observation.data(), static_cast<size_t>(observation.size())));
}

}  // namespace plumb
