// The rate of C++ that bench/python_stepping.py holds Python's against: environments side by side
// in the lanes of all threads, with what a policy needs, and nothing of Python.
//   batch_stepping ROBOT COUNT THREADS
// For each line on standard input, a number of control steps, the seconds that they took.
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <iostream>
#include <memory>
#include <vector>

#include "sim/environment.h"
#include "sim/episode.h"
#include "sim/simulator_lanes.h"
#include "trainer/workers.h"

namespace plumb {
namespace {

constexpr int kTogether = 64;
constexpr uint64_t kSeed = 1;

class Batch {
 public:
  Batch(const std::string& robot, int count, int threads)
      : model_(std::make_shared<Model>(LoadRobot(robot))), workers_(threads) {
    for (int i = 0; i < workers_.size(); ++i) lanes_.emplace_back(model_);
    moves_.resize(lanes_.size());
    for (int i = 0; i < count; ++i) environments_.emplace_back(model_);
    observations_.resize(environments_.front().observation_size(), count);
    actions_.resize(environments_.front().action_size(), count);
    Random random(kSeed);
    for (float& action : actions_.reshaped()) action = static_cast<float>(random.Uniform(-1, 1));
  }

  void Reset() {
    for (size_t i = 0; i < environments_.size(); ++i) {
      Random random = EpisodeStart(kSeed, static_cast<uint32_t>(i));
      environments_[i].Reset(random);
    }
  }

  void Step() {
    const int count = static_cast<int>(environments_.size());
    workers_.Run((count + kTogether - 1) / kTogether, [&](int task, int worker) {
      const int first = task * kTogether, last = std::min(count, first + kTogether);
      auto& moves = moves_[static_cast<size_t>(worker)];
      moves.clear();
      for (int i = first; i < last; ++i) {
        moves.push_back(
            {&environments_[static_cast<size_t>(i)], {actions_.col(i).data(), actions_.rows()}});
      }
      Environment::Step(moves, lanes_[static_cast<size_t>(worker)]);
      for (int i = first; i < last; ++i)
        environments_[static_cast<size_t>(i)].Observe(observations_.col(i));
    });
  }

 private:
  std::shared_ptr<const Model> model_;
  Workers workers_;
  std::vector<SimulatorLanes> lanes_;
  std::vector<std::vector<Environment::Move>> moves_;
  std::vector<Environment> environments_;
  Eigen::MatrixXf observations_, actions_;
};

int Main(int argc, char** argv) {
  if (argc != 4) {
    std::cerr << "usage: batch_stepping ROBOT COUNT THREADS\n";
    return 2;
  }
  Batch batch(argv[1], std::stoi(argv[2]), std::stoi(argv[3]));
  for (int steps; std::cin >> steps;) {
    batch.Reset();
    const auto begin = std::chrono::steady_clock::now();
    for (int step = 0; step < steps; ++step) batch.Step();
    const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - begin;
    std::cout << fmt::format("{:.9f}", seconds.count()) << std::endl;
  }
  return 0;
}

}  // namespace
}  // namespace plumb

int main(int argc, char** argv) { return plumb::Main(argc, argv); }
