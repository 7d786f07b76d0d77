#pragma once

#include <Eigen/Core>
#include <array>
#include <memory>
#include <span>
#include <vector>

#include "common/random.h"
#include "robot/description.h"
#include "robot/limit_effort.h"
#include "robot/residual.h"
#include "sim/correction.h"
#include "sim/effort_track.h"
#include "sim/simulator.h"
#include "sim/simulator_lanes.h"
#include "sim/tasks/task.h"

namespace plumb {

/// The outcome of a control step.
struct StepResult {
  double reward;    ///< of this step; NaN where the simulation has blown up
  bool terminated;  ///< by the task, or because the simulation has blown up; never by time
};

/// A task on a simulated robot, in control steps. One per worker; not thread-safe. After
/// construction nothing allocates. Equal parameters, state and actions give equal bits in any
/// thread.
class Environment {
 public:
  /// Has the prior means as parameters and the zero state until told otherwise.
  /// @throws std::invalid_argument if the description names an unknown task or parameter.
  explicit Environment(const RobotDescription& description);
  /// The same for a model that workers share.
  explicit Environment(const std::shared_ptr<const Model>& model);

  int observation_size() const { return task_->observation_size(); }
  int action_size() const { return task_->action_size(); }
  int parameter_count() const { return simulator_.parameter_count(); }
  /// Time limit: truncation, not termination. The environment itself does not count.
  int steps_per_episode() const { return steps_per_episode_; }

  /// @param physical in the order of description.parameters. @throws std::invalid_argument, see
  /// Parameters::Apply.
  void SetParameters(const Eigen::Ref<const Eigen::VectorXd>& physical) {
    simulator_.SetParameters(physical);
  }
  /// What has been learnt that the simulator lacks; null = nothing, it is right as it is. Holds
  /// from the next Reset on. Allocates where it is another one than the last.
  /// @param draw of the residual, to which the parameters belong.
  /// @throws std::invalid_argument if it is another robot's, or there is no such draw.
  void SetResidual(std::shared_ptr<const Residual> residual, size_t draw = 0);
  /// From now on efforts come through the robot's driver, which limits them in each of its cycles
  /// by what the joint is doing then (LimitEffort): against a stop there are none, say. Else
  /// actions act as they are, as gym's do.
  void SendThroughDriver();
  /// Draws a state of the task's initial distribution. No effort has been applied yet.
  void Reset(Random& random);
  /// @throws std::invalid_argument if the state is not finite.
  void SetState(const Eigen::Ref<const Eigen::VectorXd>& q,
                const Eigen::Ref<const Eigen::VectorXd>& v);

  /// One control period. During its first description.simulation.latency seconds the previous
  /// action still acts: on the robot, too, an effort arrives some time after the state it answers.
  /// @param action policy units, [-1, 1] = effort limits; clipped here.
  StepResult Step(const Eigen::Ref<const Eigen::VectorXf>& action);

  /// One environment's part in a step of several.
  struct Move {
    Environment* environment;
    Eigen::Map<const Eigen::VectorXf> action;
    StepResult result{};  ///< is written
  };
  /// Step of several environments of one model, side by side: each gets the bits of its own Step.
  /// @param lanes of that model. @throws std::invalid_argument, see SimulatorLanes::Run.
  static void Step(std::span<Move> moves, SimulatorLanes& lanes);

  /// Writes what the policy sees of the sensors' readings (JointDynamics), observation_size()
  /// entries.
  void Observe(Eigen::Ref<Eigen::VectorXf> observation) const;

  const Eigen::VectorXd& q() const { return simulator_.q(); }
  const Eigen::VectorXd& v() const { return simulator_.v(); }
  /// The sensors' readings.
  const Eigen::VectorXd& reading_q() const { return reading_q_; }
  const Eigen::VectorXd& reading_v() const { return reading_v_; }
  /// The efforts that the latest action asked the motors for [Nm or N], one per velocity.
  const Eigen::VectorXd& effort() const { return effort_; }
  const Task& task() const { return *task_; }

 private:
  // A step is sent in parts: without a driver it is one, with it one for each of its cycles.
  struct Part {
    double duration;  // [s]
    bool late;        // of the time when the previous action no longer acts
  };
  void Begin(const Eigen::Ref<const Eigen::VectorXf>& action);
  void Send(const Part& part);
  StepResult End();
  void Read();

  std::unique_ptr<Task> task_;
  std::shared_ptr<const Model> model_;
  Simulator simulator_;
  std::unique_ptr<Correction> correction_;  // the last one
  bool corrected_ = false;                  // it is in use
  size_t draw_ = 0;                         // of it
  int steps_per_episode_;
  double period_;
  double latency_;
  struct Drive {
    Eigen::Index position, velocity;  // in q and v
    JointLimits limits;
  };
  std::vector<Drive> drives_;  // that the driver limits
  std::vector<Part> parts_;
  // work space of Reset and Step: where an episode or a step begins
  Eigen::VectorXd start_q_, start_v_;
  // of the latest action: what it wishes for at the beginning of the next step
  Eigen::VectorXd effort_;
  Eigen::VectorXd next_effort_;
  std::array<EffortSegment, 2> profile_;  // of a step without a driver
  Eigen::VectorXd sent_;                  // of it, by the driver
  double sent_for_ = 0;                   // [s]
  Eigen::VectorXd mean_effort_, mean_effort_before_;
  Eigen::VectorXd reading_q_, reading_v_;
};

}  // namespace plumb
