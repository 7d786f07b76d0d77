#include "trainer/robot_simulation.h"

#include <memory>
#include <span>
#include <vector>

#include "robot/configuration_space.h"
#include "sim/environment.h"
#include "sim/simulator_lanes.h"

namespace plumb {
namespace {

class RobotSimulation : public Simulation {
 public:
  explicit RobotSimulation(const std::shared_ptr<const Model>& model)
      : model_(model),
        environment_(model),
        position_noise_(model->description().training.position_noise),
        velocity_noise_(model->description().training.velocity_noise),
        space_(model->description()),
        q_(environment_.q()),
        v_(environment_.v()),
        position_step_(v_.size()) {
    if (model->description().simulation.latency > 0) environment_.SendThroughDriver();
  }

  int observation_size() const override { return environment_.observation_size(); }
  int action_size() const override { return environment_.action_size(); }
  int steps_per_episode() const override { return environment_.steps_per_episode(); }
  void Reset(const SimulatorDraw& simulator, Random& random) override {
    environment_.SetParameters(simulator.parameters);
    environment_.SetResidual(simulator.residual, simulator.draw);
    environment_.Reset(random);
    if (const Eigen::VectorXd& start = simulator.start; start.size() > 0)
      environment_.SetState(start.head(q_.size()), start.tail(v_.size()));
    if (noisy()) {
      const uint64_t high = random.Bits();
      noise_ = Random(high << 32 | random.Bits());
    }
    Read();
  }
  void Observe(Eigen::Ref<Eigen::VectorXf> observation) const override {
    environment_.task().Observe(q_, v_,
                                {observation.data(), static_cast<size_t>(observation.size())});
  }
  StepResult Step(const Eigen::Ref<const Eigen::VectorXf>& action) override {
    const StepResult result = environment_.Step(action);
    Read();
    return result;
  }
  void StepTogether(std::span<Move> moves) override {
    moves_.clear();
    for (const Move& move : moves)
      moves_.push_back(
          {&static_cast<RobotSimulation*>(move.simulation)->environment_, move.action});
    if (!lanes_) lanes_ = std::make_unique<SimulatorLanes>(model_);
    Environment::Step(moves_, *lanes_);
    for (size_t i = 0; i < moves.size(); ++i) {
      moves[i].result = moves_[i].result;
      static_cast<RobotSimulation*>(moves[i].simulation)->Read();
    }
  }

 private:
  bool noisy() const { return position_noise_ > 0 || velocity_noise_ > 0; }

  void Read() {
    q_ = environment_.reading_q(), v_ = environment_.reading_v();
    if (!noisy()) return;
    Eigen::VectorXd& step = position_step_;
    for (double& entry : step) entry = position_noise_ * noise_.Normal();
    q_ = space_.Move(q_, step);
    for (double& v : v_) v += velocity_noise_ * noise_.Normal();
  }

  std::shared_ptr<const Model> model_;
  Environment environment_;
  double position_noise_, velocity_noise_;
  Random noise_{0};
  ConfigurationSpace space_;
  Eigen::VectorXd q_, v_;          // what the policy is told
  Eigen::VectorXd position_step_;  // that its q is off
  // of the one that steps others with itself
  std::unique_ptr<SimulatorLanes> lanes_;
  std::vector<Environment::Move> moves_;
};

}  // namespace

SimulationFactory SimulateRobot(const RobotDescription& description) {
  return [model = std::make_shared<const Model>(description)] {
    return std::make_unique<RobotSimulation>(model);
  };
}

}  // namespace plumb
