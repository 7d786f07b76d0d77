#pragma once

#include <benchmark/benchmark.h>

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "common/random.h"
#include "sim/environment.h"
#include "tests/sim/allocations.h"

// What our simulator and its peers are measured on.
namespace plumb {

inline RobotDescription Load(const std::string& robot) {
  return LoadRobot(PLUMBLINE_SOURCE "/robots/" + robot);
}

/// The pendulum's effort.
inline const Eigen::VectorXd kOne = Eigen::VectorXd::Constant(1, 0.7);

/// Says how often an iteration asks for memory.
class CountAllocations {
 public:
  explicit CountAllocations(benchmark::State& state) : state_(state), before_(Allocations()) {}
  ~CountAllocations() {
    state_.counters["allocations"] =
        static_cast<double>(Allocations() - before_) / static_cast<double>(state_.iterations());
  }

 private:
  benchmark::State& state_;
  int64_t before_;
};

/// Random roll-outs of the hopper, falls and all.
struct Hops {
  std::vector<Eigen::VectorXd> q, v, effort;
  size_t size() const { return q.size(); }
};

inline const Hops& RandomHops() {
  static const Hops hops = [] {
    Hops made;
    Environment hopper(Load("hopper/gym.toml"));
    Random random(5);
    hopper.Reset(random);
    while (made.size() < 1000) {
      Eigen::VectorXf action(3);
      for (float& a : action) a = static_cast<float>(random.Uniform(-1, 1));
      made.q.push_back(hopper.q());
      made.v.push_back(hopper.v());
      made.effort.push_back(Eigen::VectorXd::Zero(6));
      made.effort.back().tail(3) = 200 * action.cast<double>();
      if (hopper.Step(action).terminated) hopper.Reset(random);
    }
    return made;
  }();
  return hops;
}

template <class Step>
void ForEachHop(benchmark::State& state, Step step) {
  const Hops& hops = RandomHops();
  size_t i = 0;
  const CountAllocations count(state);
  for (auto _ : state) {
    step(hops.q[i], hops.v[i], hops.effort[i]);
    i = (i + 1) % hops.size();
  }
}

}  // namespace plumb
