#include "experiments/bus_simulation.h"

#include <condition_variable>
#include <exception>
#include <memory>
#include <mutex>
#include <thread>
#include <utility>

#include "experiments/bus_robot.h"
#include "sim/tasks/task.h"

namespace plumb {
namespace {

// Episodes are that many, of which each may come again; their times stay near the present.
constexpr uint32_t kEpisodes = 1u << 20;

// Thrown into an episode that nobody plays any more.
struct Abandoned {};

/// The robot calls for actions, the trainer for steps: an episode has a thread of its own, and only
/// one of the two is ever running.
class BusSimulation : public Simulation {
 public:
  BusSimulation(const RobotDescription& truth, const RobotDescription& model,
                const Eigen::VectorXd& hidden, uint64_t seed)
      : task_(MakeTask(model)),
        steps_(model.task.steps),
        robot_(truth, model, hidden, seed),
        observation_(task_->observation_size()) {}
  ~BusSimulation() override { Abandon(); }

  int observation_size() const override { return task_->observation_size(); }
  int action_size() const override { return task_->action_size(); }
  int steps_per_episode() const override { return steps_; }

  void Reset(const SimulatorDraw& /*simulator*/, Random& random) override {
    Abandon();
    turn_ = Turn::kRobot;
    abandoned_ = over_ = fell_ = false;
    sum_ = 0;
    failure_ = nullptr;
    episode_ = std::thread([this, number = random.Bits() % kEpisodes] { Play(number); });
    WaitForTrainersTurn();
  }
  void Observe(Eigen::Ref<Eigen::VectorXf> observation) const override {
    observation = observation_;
  }
  StepResult Step(const Eigen::Ref<const Eigen::VectorXf>& action) override {
    const double before = sum_;
    if (!over_) {
      action_ = action;
      Pass(Turn::kRobot);
      WaitForTrainersTurn();
    }
    // One that was stopped after its first states has failed.
    return {sum_ - before, over_ && fell_};
  }

 private:
  enum class Turn { kRobot, kTrainer };

  void Pass(Turn turn) {
    {
      const std::lock_guard lock(mutex_);
      turn_ = turn;
    }
    passed_.notify_one();
  }
  void WaitFor(Turn turn) {
    std::unique_lock lock(mutex_);
    passed_.wait(lock, [&] { return turn_ == turn; });
  }
  void WaitForTrainersTurn() {
    WaitFor(Turn::kTrainer);
    if (failure_) std::rethrow_exception(std::exchange(failure_, nullptr));
  }

  // In the episode's thread.
  void Play(uint32_t number) {
    try {
      const RobotEpisode episode = robot_.Play(
          [this](const Eigen::VectorXf& observation, const Trial& so_far) {
            observation_ = observation;
            sum_ = so_far.sum_of_rewards;
            Pass(Turn::kTrainer);
            WaitFor(Turn::kRobot);
            if (abandoned_) throw Abandoned();
            return action_;
          },
          number);
      sum_ = episode.sum_of_rewards;
      fell_ = episode.trial.fell;
      task_->Observe(episode.last_q, episode.last_v,
                     {observation_.data(), static_cast<size_t>(observation_.size())});
    } catch (const Abandoned&) {
    } catch (...) {
      failure_ = std::current_exception();
    }
    over_ = true;
    Pass(Turn::kTrainer);
  }

  void Abandon() {
    if (!episode_.joinable()) return;
    if (!over_) {
      abandoned_ = true;
      Pass(Turn::kRobot);
    }
    episode_.join();
  }

  std::unique_ptr<Task> task_;
  int steps_;
  BusRobot robot_;
  std::thread episode_;
  std::mutex mutex_;
  std::condition_variable passed_;
  Turn turn_ = Turn::kTrainer;
  // Whose turn it is owns these.
  Eigen::VectorXf observation_, action_;
  double sum_ = 0;
  bool over_ = true, fell_ = false, abandoned_ = false;
  std::exception_ptr failure_;
};

}  // namespace

SimulationFactory SimulateBusRobot(const RobotDescription& truth, const RobotDescription& model,
                                   const Eigen::VectorXd& hidden, uint64_t seed) {
  return [=] { return std::make_unique<BusSimulation>(truth, model, hidden, seed); };
}

}  // namespace plumb
