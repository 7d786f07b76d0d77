#include "trainer/robot_simulation.h"

#include <memory>

#include "sim/environment.h"

namespace plumb {
namespace {

class RobotSimulation : public Simulation {
 public:
  explicit RobotSimulation(std::shared_ptr<const Model> model) : environment_(std::move(model)) {}

  int observation_size() const override { return environment_.observation_size(); }
  int action_size() const override { return environment_.action_size(); }
  int steps_per_episode() const override { return environment_.steps_per_episode(); }
  void Reset(const Eigen::VectorXd& parameters, Random& random) override {
    environment_.SetParameters(parameters);
    environment_.Reset(random);
  }
  void Observe(Eigen::Ref<Eigen::VectorXf> observation) const override { environment_.Observe(observation); }
  Outcome Step(const Eigen::Ref<const Eigen::VectorXf>& action) override {
    const Environment::StepResult result = environment_.Step(action);
    return {result.reward, result.terminated};
  }

 private:
  Environment environment_;
};

}  // namespace

SimulationFactory SimulateRobot(const RobotDescription& description) {
  return [model = std::make_shared<const Model>(description)] { return std::make_unique<RobotSimulation>(model); };
}

}  // namespace plumb
