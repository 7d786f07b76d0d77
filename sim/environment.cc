#include "sim/environment.h"

#include <algorithm>
#include <span>
#include <stdexcept>

namespace plumb {

Environment::Environment(const RobotDescription& description)
    : Environment(std::make_shared<Model>(description)) {}

Environment::Environment(std::shared_ptr<const Model> model)
    : task_(MakeTask(model->description())),
      model_(model),
      simulator_(model),
      steps_per_episode_(model->description().task.steps),
      period_(model->description().task.period),
      latency_(std::clamp(model->description().simulation.latency, 0.0, period_)),
      start_q_(Eigen::VectorXd::Zero(model->num_positions())),
      start_v_(Eigen::VectorXd::Zero(model->num_velocities())),
      effort_(start_v_),
      next_effort_(start_v_),
      mean_effort_(start_v_),
      mean_effort_before_(start_v_),
      reading_q_(simulator_.q()),
      reading_v_(simulator_.v()) {}

void Environment::SetResidual(std::shared_ptr<const Residual> residual, size_t draw) {
  if (residual != (lack_ ? lack_->residual : nullptr)) {
    lack_.reset();
    if (!residual) return;
    RequireResidualOf(model_->description(), *residual);
    ResidualInputs inputs(*model_, residual->margin);
    ResidualSample sample(*residual);
    lack_.reset(new Lack{std::move(residual), std::move(sample), std::move(inputs)});
  }
  if (!lack_) return;
  if (draw >= lack_->residual->coordinates.size())
    throw std::invalid_argument("the residual has no such draw");
  lack_->draw = draw;
}

void Environment::Reset(Random& random) {
  if (lack_) lack_->sample.Begin(lack_->draw, random);
  task_->InitialState(random, start_q_, start_v_);
  SetState(start_q_, start_v_);
}

void Environment::SetState(const Eigen::Ref<const Eigen::VectorXd>& q,
                           const Eigen::Ref<const Eigen::VectorXd>& v) {
  simulator_.SetState(q, v);
  effort_.setZero();
  mean_effort_before_.setZero();
  Read();
}

StepResult Environment::Step(const Eigen::Ref<const Eigen::VectorXf>& action) {
  task_->Effort(std::span(action.data(), static_cast<size_t>(action.size())), next_effort_);
  start_q_ = q();
  start_v_ = v();
  if (lack_) {
    mean_effort_ = (latency_ * effort_ + (period_ - latency_) * next_effort_) / period_;
    lack_->inputs.Begin(simulator_, mean_effort_, mean_effort_before_, period_);
  }
  simulator_.Step(effort_, latency_);
  simulator_.Step(next_effort_, period_ - latency_);
  effort_.swap(next_effort_);
  if (lack_) Correct();
  Read();
  return {task_->Reward(start_q_, start_v_, effort_, q(), v()),
          !simulator_.finite() || task_->Terminated(q(), v())};
}

void Environment::Correct() {
  lack_->inputs.End(simulator_);
  const Eigen::VectorXd& dv = lack_->sample.Step(lack_->inputs.touching(), lack_->inputs.x());
  // as if the acceleration that was left out had been constant
  next_effort_ = period_ / 2 * dv;
  simulator_.Correct(next_effort_, dv);
  mean_effort_before_.swap(mean_effort_);
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
