#include "experiments/bus_robot.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <stdexcept>
#include <utility>

#include "calibrator/motion/transitions.h"
#include "common/time_units.h"
#include "controller/controller.h"
#include "estimator/state_observer.h"
#include "plumb/controller_status_t.hpp"
#include "plumb/driver_request_t.hpp"
#include "plumb/policy_t.hpp"
#include "sim/tasks/task.h"
#include "sim/virtual/virtual_bus.h"

namespace plumb {
namespace {

constexpr uint32_t kStandStream = 0x5374616E;           // of random numbers; "Stan"
constexpr int64_t kFirstStart = 1'700'000'000'000'000;  // [us] utime of episode 0: a time as any
// [us] so that no two episodes begin at the same time
constexpr int64_t kBetweenEpisodes = 1'000'000'000;
// [us] periods of requests and of DRIVER_STATUS
constexpr int64_t kArmAgain = 500'000, kStatus = 100'000;
constexpr int64_t kPatience = 30'000'000;  // [us] until the episode has begun
constexpr int64_t kSlice = 10'000;         // [us] in which plumb-controller looks at its clock

/// The processes that are switched on for one episode, in one loop on one bus.
class BusLoop {
 public:
  BusLoop(const RobotDescription& truth, const RobotDescription& model,
          const Eigen::VectorXd& hidden, uint64_t seed, int64_t start, int64_t phase)
      : bus_(truth, hidden, model, start,
             {Microseconds(truth.driver.effort_delay), Microseconds(truth.estimator.delay)}, phase),
        observer_(model),
        controller_(model, seed),
        joiner_(TransitionJoiner::Unbounded(model)),
        per_step_(std::llround(model.task.period / model.driver.measurement)) {
    bus_.on_imu = [this](const imu_t& imu) { observer_.OnImu(imu); };
    bus_.on_state = [this](const joint_state_t& measured) { OnMeasurement(measured); };
    bus_.on_cycle = [this] { OnCycle(); };
  }

  VirtualRobot& robot() { return bus_.robot(); }
  void SetPolicy(const policy_t& policy) { controller_.OnPolicy(policy); }
  void SetDecision(const Controller::Decide& decide) { controller_.SetDecision(decide); }
  /// With which the episode has ended.
  const robot_state_t& last() const { return last_state_; }
  const controller_status_t& status() const { return controller_.status(); }

  /// @throws std::runtime_error if it does not come to that.
  void BeginEpisode() {
    for (int64_t next_request = kArmAgain; last_.episode < 0; bus_.Advance(bus_.now() + kSlice)) {
      if (bus_.now() >= kPatience) {
        throw std::runtime_error("the robot does not begin an episode: the controller says '" +
                                 status().reason + "', the driver '" +
                                 std::string(bus_.driver().reason()) + "'");
      }
      if (bus_.driver().state() == DriveState::kArmed || bus_.now() < next_request) continue;
      driver_request_t arm{};
      arm.utime = bus_.utime();
      arm.request = driver_request_t::ARM;
      bus_.driver().OnRequest(arm, bus_.now(), bus_.utime());
      next_request = bus_.now() + kArmAgain;
    }
  }
  /// And until its last state has been smoothed.
  void FinishEpisode() {
    while (status().phase == controller_status_t::RUNNING) bus_.Advance(bus_.now() + kSlice);
    const int64_t patience = bus_.now() + kStatus + 10 * kSlice;
    while (joiner_.newest_state() < last_state() && bus_.now() < patience)
      bus_.Advance(bus_.now() + kSlice);
  }
  Rollout Join() { return joiner_.Join(last_.episode, last_state()); }

 private:
  int64_t last_state() const {
    const auto& finished = status().last_state_sequence;
    return finished.empty() ? last_.state_sequence + per_step_ : finished.back();
  }

  void OnMeasurement(const joint_state_t& measured) {
    if (!observer_.OnJointState(measured)) return;
    for (const robot_state_t& state : observer_.smoothed()) joiner_.OnState(state);
    const bool running = status().phase == controller_status_t::RUNNING;
    Send(controller_.OnState(observer_.state(), bus_.now(), bus_.utime()));
    if (running) last_state_ = observer_.state();
  }
  void OnCycle() {
    Driver& driver = bus_.driver();
    if (driver.revision() != revision_ || bus_.now() >= next_status_) {
      controller_.OnDriverStatus(driver.Status(bus_.utime(), {}, 0), bus_.now());
      revision_ = driver.revision();
      next_status_ = bus_.now() + kStatus;
    }
    Send(controller_.Tick(bus_.now(), bus_.utime()));
    if (const place_robot_t* place = controller_.place()) {
      robot().Place(
          place->utime,
          Eigen::VectorXd::Map(place->q.data(), static_cast<Eigen::Index>(place->q.size())),
          Eigen::VectorXd::Map(place->v.data(), static_cast<Eigen::Index>(place->v.size())));
    }
  }
  void Send(const std::optional<joint_command_t>& command) {
    if (!command) return;
    bus_.driver().OnCommand(*command, bus_.now(), bus_.utime());
    joiner_.OnCommand(*command);
    if (command->episode >= 0) last_ = *command;
  }

  VirtualBus bus_;
  StateObserver observer_;
  Controller controller_;
  TransitionJoiner joiner_;
  const int64_t per_step_;  // measurements
  joint_command_t last_ = [] {
    joint_command_t none{};
    none.episode = -1;
    return none;
  }();
  robot_state_t last_state_{};
  uint64_t revision_ = std::numeric_limits<uint64_t>::max();
  int64_t next_status_ = 0;
};

}  // namespace

BusRobot::BusRobot(RobotDescription truth, RobotDescription model, Eigen::VectorXd hidden,
                   uint64_t seed)
    : truth_(std::move(truth)), model_(std::move(model)), hidden_(std::move(hidden)), seed_(seed) {}

RobotEpisode BusRobot::Run(const GaussianPolicy& policy, bool explore, int steps, uint32_t number) {
  policy_t message = policy.ToMessage();
  message.iteration = static_cast<int32_t>(number);
  message.purpose = explore ? policy_t::CALIBRATE : policy_t::EVALUATE;
  return Episode(message, {}, steps);
}

RobotEpisode BusRobot::Play(const Controller::Decide& decide, uint32_t number) {
  const auto task = MakeTask(model_);
  GaussianPolicy nobody({task->observation_size(), {}, task->action_size()});
  nobody.action_scale = model_.effort_limits().cast<float>();
  policy_t message = nobody.ToMessage();
  message.iteration = static_cast<int32_t>(number);
  message.purpose = policy_t::EVALUATE;
  return Episode(message, decide, model_.task.steps);
}

RobotEpisode BusRobot::Episode(const policy_t& policy, const Controller::Decide& decide,
                               int steps) {
  const auto number = static_cast<uint32_t>(policy.iteration);
  policy_t message = policy;
  message.episodes = 1;
  RobotDescription model = model_;
  model.task.steps = std::min(steps, model.task.steps);
  // Drives and driver do not wait for each other.
  Random random(seed_, {kStandStream, number});
  const int64_t phase = Microseconds(random.Uniform(0, model.driver.cycle));
  BusLoop loop(truth_, model, hidden_, seed_, kFirstStart + number * kBetweenEpisodes, phase);
  loop.SetPolicy(message);
  loop.SetDecision(decide);

  // Switched on, it lies about as it may, but not in the ground.
  Eigen::VectorXd q(model.num_positions()), v(model.num_velocities());
  MakeTask(model)->InitialState(random, q, v);
  loop.robot().Place(0, q, v);

  loop.BeginEpisode();
  loop.FinishEpisode();
  const controller_status_t& status = loop.status();
  const bool counts = !status.returns.empty();
  stopped_ = status.phase == controller_status_t::COMPLETE ? "" : status.reason;
  RobotEpisode episode;
  if (!decide) episode.rollout = loop.Join();
  episode.trial = counts ? Trial{status.steps.back(), status.returns.back(),
                                 status.late_rate.back(), status.fell.back() != 0}
                         : Trial::Stopped(status.step, status.episode_return);
  episode.sum_of_rewards =
      counts ? status.returns.back() : episode.trial.WholeReturn(model.task.steps);
  episode.seconds = status.step * model.task.period;
  const robot_state_t& last = loop.last();
  episode.last_q = Eigen::VectorXd::Map(last.q.data(), static_cast<Eigen::Index>(last.q.size()));
  episode.last_v = Eigen::VectorXd::Map(last.v.data(), static_cast<Eigen::Index>(last.v.size()));
  return episode;
}

}  // namespace plumb
