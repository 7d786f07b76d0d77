#include "sim/environment.h"

#include <algorithm>
#include <span>

namespace plumb {

Environment::Environment(const RobotDescription& description)
    : Environment(std::make_shared<Model>(description)) {}

Environment::Environment(std::shared_ptr<const Model> model)
    : task_(MakeTask(model->description())),
      simulator_(model),
      steps_per_episode_(model->description().task.steps),
      period_(model->description().task.period),
      latency_(std::clamp(model->description().simulation.latency, 0.0, period_)),
      start_q_(Eigen::VectorXd::Zero(model->num_positions())),
      start_v_(Eigen::VectorXd::Zero(model->num_velocities())),
      effort_(start_v_),
      next_effort_(start_v_),
      reading_q_(simulator_.q()),
      reading_v_(simulator_.v()) {}

void Environment::Reset(Random& random) {
  task_->InitialState(random, start_q_, start_v_);
  SetState(start_q_, start_v_);
}

void Environment::SetState(const Eigen::Ref<const Eigen::VectorXd>& q,
                           const Eigen::Ref<const Eigen::VectorXd>& v) {
  simulator_.SetState(q, v);
  effort_.setZero();
  Read();
}

StepResult Environment::Step(const Eigen::Ref<const Eigen::VectorXf>& action) {
  task_->Effort(std::span(action.data(), static_cast<size_t>(action.size())), next_effort_);
  start_q_ = q();
  start_v_ = v();
  simulator_.Step(effort_, latency_);
  simulator_.Step(next_effort_, period_ - latency_);
  effort_.swap(next_effort_);
  Read();
  return {task_->Reward(start_q_, start_v_, effort_, q(), v()),
          !simulator_.finite() || task_->Terminated(q(), v())};
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
