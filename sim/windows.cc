#include "sim/windows.h"

#include <algorithm>
#include <cmath>
#include <exception>
#include <numeric>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>

#include "common/special_numbers.h"
#include "sim/window_groups.h"

namespace plumb {
namespace {

// Groups whose efforts are worked out together, once for all samples.
constexpr size_t kLargestBlock = 16;

}  // namespace

// One thread's engine, and the efforts of some groups, substep by substep.
struct Windows::Worker {
  struct Plan {
    std::vector<double> lengths;         // [step][lane]: of a substep
    std::vector<double> means, moments;  // [substep][velocity][lane]
    std::vector<char> steady;            // [substep]: all moments are zero
    std::vector<double> arriving;        // [step][velocity][lane]: effort that acts at its end
    std::vector<double> first;           // [velocity][lane]: effort at the beginning
  };

  explicit Worker(const Model& its_model)
      : model(its_model),
        engine(model.NewWideEngine()),
        lanes(static_cast<size_t>(engine->lanes())),
        physics(model.parameters().Nominal()),
        track(model.num_velocities(), JointDynamics::kLongestDelay),
        plans(kLargestBlock),
        q(model.num_positions()),
        v(model.num_velocities()) {}

  void MakePlan(const WindowGroup& group, std::span<const Window> windows, Plan* plan) {
    const auto n = static_cast<size_t>(model.num_velocities());
    const auto substeps =
        static_cast<size_t>(std::accumulate(group.counts.begin(), group.counts.end(), 0));
    plan->lengths.resize(group.counts.size() * lanes);
    plan->means.resize(substeps * n * lanes);
    plan->moments.resize(plan->means.size());
    plan->steady.assign(substeps, 1);
    plan->arriving.resize(group.counts.size() * n * lanes);
    plan->first.resize(n * lanes);
    for (size_t lane = 0; lane < lanes; ++lane) {
      const Window& window = windows[group.windows[lane]];
      track.Clear();
      if (model.parameters().delays()) {
        for (const auto& step : window.before) Append(step);
      }
      track.Advance();
      size_t substep = 0;
      for (size_t step = 0; step < window.steps.size(); ++step) {
        if (!model.parameters().delays()) track.Clear();
        Append(window.steps[step]);
        const double h = Duration(window.steps[step]) / group.counts[step];
        plan->lengths[step * lanes + lane] = h;
        for (int k = 0; k < group.counts[step]; ++k, ++substep) {
          for (size_t i = 0; i < n; ++i) {
            const EffortTrack::Moments moments =
                track.Over(i, k * h, (k + 1) * h, physics.axes[i].delay);
            const size_t at = (substep * n + i) * lanes + lane;
            plan->means[at] = moments.mean;
            plan->moments[at] = moments.first;
            if (moments.first != 0) plan->steady[substep] = 0;
            if (substep == 0) plan->first[i * lanes + lane] = track.At(i, 0, physics.axes[i].delay);
          }
        }
        track.Advance();
        for (size_t i = 0; i < n; ++i) {
          plan->arriving[(step * n + i) * lanes + lane] = track.At(i, 0, physics.axes[i].delay);
        }
      }
    }
  }

  // Besides the windows, all that a plan depends on.
  std::vector<double> Delays() const {
    std::vector<double> delays;
    for (const auto& axis : physics.axes) delays.push_back(axis.delay);
    return delays;
  }

  void Append(std::span<const EffortSegment> segments) {
    for (const EffortSegment& segment : segments)
      track.Append(segment.effort.data(), segment.duration);
  }

  void Simulate(Eigen::Index sample, const WindowGroup& group, std::span<const Window> windows,
                const Plan& plan, const Visit& visit, bool last_only) {
    const auto n = static_cast<size_t>(model.num_velocities());
    const bool sensors = model.parameters().sensor_errors();
    for (size_t lane = 0; lane < lanes; ++lane) {
      const Window& window = windows[group.windows[lane]];
      for (Eigen::Index i = 0; i < q.size(); ++i)
        engine->q()[static_cast<size_t>(i) * lanes + lane] = window.q[i];
      for (Eigen::Index i = 0; i < v.size(); ++i)
        engine->v()[static_cast<size_t>(i) * lanes + lane] = window.v[i];
    }
    if (sensors) engine->FromReading(plan.first.data());
    failed.assign(lanes, 0);
    size_t substep = 0;
    for (size_t step = 0; step < group.counts.size(); ++step) {
      for (int k = 0; k < group.counts[step]; ++k, ++substep) {
        const double* moment = plan.steady[substep] ? nullptr : &plan.moments[substep * n * lanes];
        engine->Substep(&plan.lengths[step * lanes], &plan.means[substep * n * lanes], moment);
      }
      const bool last = step + 1 == group.counts.size();
      if (last_only && !last) continue;
      if (sensors) Read(plan, step);
      for (size_t lane = 0; lane < group.used; ++lane) {
        for (Eigen::Index i = 0; i < q.size(); ++i)
          q[i] = engine->q()[static_cast<size_t>(i) * lanes + lane];
        for (Eigen::Index i = 0; i < v.size(); ++i)
          v[i] = engine->v()[static_cast<size_t>(i) * lanes + lane];
        const bool good = q.cwiseAbs().maxCoeff() < kFarthest &&
                          v.cwiseAbs().maxCoeff() < kFarthest && q.allFinite() && v.allFinite();
        if (!good) failed[lane] = 1;  // and remains so
        if (failed[lane]) Fail();
        failures.diverged += last && failed[lane];
        visit(sample, group.windows[lane], step, q, v);
      }
      if (sensors && !last) Restore();
    }
  }

  // Readings in place of the state, which is kept.
  void Read(const Plan& plan, size_t step) {
    const auto n = static_cast<size_t>(model.num_velocities());
    state.assign(engine->q(), engine->q() + static_cast<size_t>(q.size()) * lanes);
    state.insert(state.end(), engine->v(), engine->v() + n * lanes);
    engine->ToReading(&plan.arriving[step * n * lanes]);
  }
  void Restore() {
    const auto positions = static_cast<std::ptrdiff_t>(static_cast<size_t>(q.size()) * lanes);
    std::copy(state.begin(), state.begin() + positions, engine->q());
    std::copy(state.begin() + positions, state.end(), engine->v());
  }

  void Fail() {
    q.setConstant(kNaN);
    v.setConstant(kNaN);
  }

  // Samples [first, end) of these groups.
  void Run(const Eigen::MatrixXd& parameters, Eigen::Index first, Eigen::Index end,
           std::span<const Window> windows, std::span<const WindowGroup* const> groups,
           const Visit& visit, bool last_only) {
    for (size_t begin = 0; begin < groups.size(); begin += kLargestBlock) {
      const size_t size = std::min(kLargestBlock, groups.size() - begin);
      std::vector<double> planned;  // with these delays; most samples have those of the one before
      for (Eigen::Index sample = first; sample < end; ++sample) {
        try {
          model.parameters().Apply(parameters.col(sample), &physics);
        } catch (const std::invalid_argument&) {
          Fail();
          for (size_t i = 0; i < size; ++i) Refuse(sample, *groups[begin + i], visit, last_only);
          continue;
        }
        engine->SetPhysics(physics);
        if (const std::vector<double> delays = Delays(); delays != planned) {
          for (size_t i = 0; i < size; ++i) MakePlan(*groups[begin + i], windows, &plans[i]);
          planned = delays;
        }
        for (size_t i = 0; i < size; ++i)
          Simulate(sample, *groups[begin + i], windows, plans[i], visit, last_only);
      }
    }
  }

  void Refuse(Eigen::Index sample, const WindowGroup& group, const Visit& visit, bool last_only) {
    for (size_t lane = 0; lane < group.used; ++lane) {
      ++failures.impossible;
      for (size_t step = last_only ? group.counts.size() - 1 : 0; step < group.counts.size();
           ++step) {
        visit(sample, group.windows[lane], step, q, v);
      }
    }
  }

  const Model& model;
  std::unique_ptr<Engine> engine;
  size_t lanes;
  Physics<double> physics;
  EffortTrack track;
  std::vector<Plan> plans;
  std::vector<double> state;
  std::vector<char> failed;  // in each lane
  Eigen::VectorXd q, v;
  Failures failures;
};

Windows::Windows(std::shared_ptr<const Model> model, int threads) : model_(std::move(model)) {
  for (int i = 0; i < std::max(1, threads); ++i)
    workers_.push_back(std::make_unique<Worker>(*model_));
}

Windows::Windows(Windows&&) noexcept = default;
Windows::~Windows() = default;

Windows::Failures Windows::Predict(const Eigen::MatrixXd& parameters,
                                   std::span<const Window> windows, const Visit& visit,
                                   bool last_only) {
  if (parameters.rows() != model_->parameters().size()) {
    throw std::invalid_argument("the simulator has " + std::to_string(model_->parameters().size()) +
                                " parameters, not " + std::to_string(parameters.rows()));
  }
  const std::vector<WindowGroup> groups = GroupWindows(windows, *model_, workers_[0]->lanes);
  const size_t count = workers_.size();
  // Every count-th group, as the long ones come last; or, where there are too few, some of the
  // samples.
  const bool by_group = groups.size() >= count;
  std::vector<std::exception_ptr> errors(count);
  const auto work = [&](size_t worker) {
    workers_[worker]->failures = {};
    try {
      std::vector<const WindowGroup*> mine;
      for (size_t i = by_group ? worker : 0; i < groups.size(); i += by_group ? count : 1)
        mine.push_back(&groups[i]);
      const auto share = [&](size_t i) {
        return by_group ? 0
                        : static_cast<Eigen::Index>(i) * parameters.cols() /
                              static_cast<Eigen::Index>(count);
      };
      workers_[worker]->Run(parameters, share(worker),
                            by_group ? parameters.cols() : share(worker + 1), windows, mine, visit,
                            last_only);
    } catch (...) {
      errors[worker] = std::current_exception();
    }
  };
  {
    std::vector<std::jthread> threads;
    for (size_t i = 1; i < count; ++i) threads.emplace_back(work, i);
    work(0);
  }
  for (const std::exception_ptr& error : errors) {
    if (error) std::rethrow_exception(error);
  }
  Failures failures;
  for (const auto& worker : workers_) {
    failures.impossible += worker->failures.impossible;
    failures.diverged += worker->failures.diverged;
  }
  return failures;
}

}  // namespace plumb
