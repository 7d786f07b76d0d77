#pragma once

#include <algorithm>
#include <cmath>
#include <memory>

#include "robot/description.h"
#include "trainer/rollout.h"

namespace plumb {

/// Pendulum by gym's formula; parameters (g, m, l). Time limit 200 steps, never terminates.
class GymPendulum : public Simulation {
 public:
  int observation_size() const override { return 3; }
  int action_size() const override { return 1; }
  int steps_per_episode() const override { return 200; }
  void Reset(const SimulatorDraw& simulator, Random& random) override {
    parameters_ = simulator.parameters;
    angle_ = random.Uniform(-M_PI, M_PI);
    speed_ = random.Uniform(-1, 1);
  }
  void Observe(Eigen::Ref<Eigen::VectorXf> observation) const override {
    observation << static_cast<float>(std::cos(angle_)), static_cast<float>(std::sin(angle_)),
        static_cast<float>(speed_);
  }
  StepResult Step(const Eigen::Ref<const Eigen::VectorXf>& action) override {
    const double g = parameters_[0], m = parameters_[1], l = parameters_[2];
    const double torque = 2 * std::clamp(double{action[0]}, -1., 1.);
    const double wrapped = std::remainder(angle_, 2 * M_PI);
    const double cost = wrapped * wrapped + .1 * speed_ * speed_ + .001 * torque * torque;
    speed_ += .05 * (3 * g / (2 * l) * std::sin(angle_) + 3 * torque / (m * l * l));
    speed_ = std::clamp(speed_, -8., 8.);
    angle_ += .05 * speed_;
    return {-cost, false};
  }

 private:
  Eigen::VectorXd parameters_;
  double angle_ = 0, speed_ = 0;
};

inline std::unique_ptr<Simulation> MakeGymPendulum() { return std::make_unique<GymPendulum>(); }
inline Eigen::VectorXd GymParameters(Random&) { return Eigen::Vector3d(10, 1, 1); }

/// The table of the paper, with value targets normalised and a fifth of the batch for Fisher's
/// matrix.
inline TrainingSettings PendulumSettings() {
  TrainingSettings settings{};
  settings.batch = 3000;
  settings.updates = 60;
  settings.updates_again = 15;
  settings.hidden = {128, 128};
  settings.gamma = .995;
  settings.lambda = .97;
  settings.kl = .01;
  settings.damping = .1;
  settings.cg_iterations = 10;
  settings.fisher_fraction = .2;
  settings.critic_l2 = 1e-3;
  settings.critic_rate = 3e-4;
  settings.critic_epochs = 10;
  settings.critic_minibatch = 120;
  return settings;
}

}  // namespace plumb
