// The time of calibrating the hopper's four masses from 1000 transitions, in one thread:
//   build/bench/calibrator_bench [--benchmark_filter=...]
// as they stream in (median, 99th percentile and longest of the transitions, each repeated), and
// all at once.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <ctime>
#include <utility>
#include <vector>

#include "calibrator/fit/curriculum.h"
#include "calibrator/fit/robot_least_squares.h"
#include "calibrator/fit/streaming.h"
#include "common/median.h"
#include "tests/calibrator/hopper.h"

namespace plumb {
namespace {

constexpr int kTransitions = 1000;

struct HopperLog {
  explicit HopperLog(double start_sd)
      : robot(LoadRobot(PLUMBLINE_SOURCE "/robots/hopper/gym.toml")),
        model(std::make_shared<Model>(robot)) {
    rollouts = RandomRollouts(robot, RandomMasses(robot, 1), kTransitions, 1e-4, 1);
    if (start_sd == 0) return;
    for (Rollout& rollout : rollouts) {
      for (Transition& t : rollout.transitions) {
        t.q_sd.setConstant(start_sd), t.v_sd.setConstant(start_sd);
        t.next_q_sd.setConstant(1e-2), t.next_v_sd.setConstant(1e-2);
      }
    }
  }
  RobotDescription robot;
  std::shared_ptr<const Model> model;
  std::vector<Rollout> rollouts;
};

// Of this thread: others may be at work, too.
double ProcessorSeconds() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

/// A log of 1000 transitions, one by one. Argument: 1 = both ends of known uncertainty, as a
/// robot's are; 0 = starts exact.
void StreamingTransition(benchmark::State& state) {
  const HopperLog log(state.range(0) == 1 ? 1e-3 : 0);
  std::vector<std::vector<double>> repeats(kTransitions);  // of each transition
  for (auto _ : state) {
    StreamingLaplace stream(log.model);
    auto repeat = repeats.begin();
    for (const Rollout& rollout : log.rollouts) {
      for (const Transition& t : rollout.transitions) {
        const double start = ProcessorSeconds();
        stream.Add(t, rollout.episode);
        repeat++->push_back(ProcessorSeconds() - start);
      }
    }
    benchmark::DoNotOptimize(stream.standard().mean.data());
  }
  // The same work each time: what differs is the machine.
  std::vector<double> seconds;
  for (std::vector<double>& repeat : repeats) seconds.push_back(Median(std::move(repeat)));
  std::sort(seconds.begin(), seconds.end());
  const auto quantile = [&](double share) {
    return 1e6 * seconds[static_cast<size_t>(share * static_cast<double>(seconds.size() - 1))];
  };
  state.counters["p50_us"] = quantile(0.5);
  state.counters["p99_us"] = quantile(0.99);
  state.counters["max_us"] = quantile(1);
  state.SetItemsProcessed(state.iterations() * kTransitions);
}
BENCHMARK(StreamingTransition)->Arg(0)->Arg(1)->Unit(benchmark::kMillisecond)->Iterations(9);

/// From the last transition to the batch's answer.
void StreamingSettle(benchmark::State& state) {
  const HopperLog log(0);
  for (auto _ : state) {
    state.PauseTiming();
    StreamingLaplace stream(log.model);
    for (const Rollout& rollout : log.rollouts) {
      for (const Transition& t : rollout.transitions) stream.Add(t, rollout.episode);
    }
    state.ResumeTiming();
    benchmark::DoNotOptimize(stream.Settle());
  }
}
BENCHMARK(StreamingSettle)->Unit(benchmark::kMillisecond)->Iterations(5);

void OneStepFit(benchmark::State& state) {
  const HopperLog log(0);
  for (auto _ : state) {
    WindowErrors errors(log.model, log.rollouts, 1, 1);
    const Eigen::VectorXd start =
        PriorOf(log.robot).FromStandard(Eigen::VectorXd::Zero(errors.parameter_count()));
    benchmark::DoNotOptimize(FitLaplace(ProblemOf(log.robot, errors), start).mode.data());
  }
}
BENCHMARK(OneStepFit)->Unit(benchmark::kMillisecond);

void CurriculumFit(benchmark::State& state) {
  const HopperLog log(0);
  for (auto _ : state)
    benchmark::DoNotOptimize(FitCurriculum(log.model, log.rollouts, {}).fit.mode.data());
}
BENCHMARK(CurriculumFit)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace plumb
