#pragma once

#include "tests/trainer/pendulum.h"
#include "trainer/trainer.h"

namespace plumb {

inline TrainingSettings SmallSettings() {
  TrainingSettings settings = PendulumSettings();
  settings.batch = 1000;
  settings.hidden = {20, 20};
  return settings;
}

inline Eigen::VectorXd PendulumScale() { return Eigen::VectorXd::Constant(1, 2); }

/// One reward for ever; the time limit is all that ever happens.
class Endless : public Simulation {
 public:
  int observation_size() const override { return 1; }
  int action_size() const override { return 1; }
  int steps_per_episode() const override { return 20; }
  void Reset(const SimulatorDraw&, Random& random) override {
    observation_ = static_cast<float>(random.Normal());
  }
  void Observe(Eigen::Ref<Eigen::VectorXf> observation) const override {
    observation[0] = observation_;
  }
  StepResult Step(const Eigen::Ref<const Eigen::VectorXf>&) override { return {-1, false}; }

 private:
  float observation_ = 0;
};

}  // namespace plumb
