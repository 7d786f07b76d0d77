#include "trainer/critic.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <stdexcept>
#include <utility>

#include "trainer/initialization.h"

namespace plumb {
namespace {

std::vector<int> Sizes(const TrainingSettings& settings, int observations) {
  std::vector<int> sizes{observations};
  sizes.insert(sizes.end(), settings.hidden.begin(), settings.hidden.end());
  sizes.push_back(1);
  return sizes;
}

// A minibatch is shared by so many tasks, whatever the number of threads and ranks: sums over them
// are taken in order. More would be too small to be worth handing to another thread.
constexpr int kShares = 2;

// Which neighbour has which shares of a minibatch; one, if all of them do all of it. Threads share
// it among themselves, and two of them improve policy and critic side by side: MPI is for one.
std::vector<int> ShareBounds(const Ranks& neighbours, int threads) {
  const std::vector<int> all = neighbours.Collect(threads);
  const bool alone = std::any_of(all.begin(), all.end(), [](int n) { return n > 1; });
  return (alone ? Ranks::Alone() : neighbours).Bounds(kShares);
}

}  // namespace

Critic::Critic(const TrainingSettings& settings, int observations, Random random, Workers& workers,
               const Ranks& ranks)
    : settings_(settings),
      observations_(observations),
      workers_(&workers),
      network_(Sizes(settings, observations), workers, ranks),
      neighbours_(ranks.OnThisMachine()),
      bounds_(ShareBounds(neighbours_, workers.size())) {
  state_.parameters = OrthogonalParameters(Sizes(settings, observations), 1, random);
  state_.first_moment.setZero(state_.parameters.size());
  state_.second_moment.setZero(state_.parameters.size());
  const std::vector<int> sizes = Sizes(settings, observations);
  for (int i = 0; i < kShares; ++i) {
    shares_.push_back({kernels::Tape(sizes, settings.critic_minibatch / kShares + 1), {}, {}, {}});
  }
  gradients_.resize(state_.parameters.size(), kShares);
  for (int i = 0; i < workers.size(); ++i) copies_.push_back({kernels::Network(sizes)});
}

void Critic::Restore(CriticState state) {
  const Eigen::Index count = network_.parameter_count();
  if (state.parameters.size() != count || state.first_moment.size() != count ||
      state.second_moment.size() != count) {
    throw std::invalid_argument("critic: state of another network");
  }
  state_ = std::move(state);
}

std::vector<double> Critic::Values(std::span<const float> observations) {
  const size_t count = observations.size() / static_cast<size_t>(observations_);
  std::vector<float> outputs(count);
  network_.Set(state_.parameters);
  network_.Forward(observations.data(), static_cast<int>(count), outputs.data());
  std::vector<double> values(count);
  const double mean = state_.targets.mean, sd = state_.targets.sd();
  std::transform(outputs.begin(), outputs.end(), values.begin(),
                 [&](float y) { return mean + sd * y; });
  return values;
}

void Critic::Rescale(std::span<const double> targets) {
  const bool first = state_.targets.count == 0;
  const double old_mean = state_.targets.mean, old_sd = state_.targets.sd();
  for (const double target : targets) state_.targets.Add(target);
  const double mean = state_.targets.mean, sd = state_.targets.sd();
  if (first) return;  // a fresh network's values are nothing worth keeping
  // The output layer is the tail: one weight per unit below it, then the bias.
  auto output = state_.parameters.tail(settings_.hidden.empty() ? observations_ + 1
                                                                : settings_.hidden.back() + 1);
  output *= static_cast<float>(old_sd / sd);
  state_.parameters.tail(1).array() += static_cast<float>((old_mean - mean) / sd);
}

// One step of Adam. Both halves, gradient and step, are shared by the threads; ranks share the
// gradient.
void Critic::Descend(std::span<const float> observations, std::span<const float> targets,
                     std::span<const int> samples, float l2) {
  const int size = static_cast<int>(samples.size());
  const bool shared = bounds_.size() > 2;
  const auto self = static_cast<size_t>(shared ? neighbours_.rank() : 0);
  const int first_share = bounds_[self], own_shares = bounds_[self + 1] - first_share;
  workers_->Run(own_shares, [&](int own_share, int worker) {
    const int task = first_share + own_share;
    Copy& copy = copies_[static_cast<size_t>(worker)];
    if (copy.adam_steps != state_.adam_steps) {
      copy.network.Set({state_.parameters.data(), static_cast<size_t>(state_.parameters.size())});
      copy.adam_steps = state_.adam_steps;
    }
    Share& share = shares_[static_cast<size_t>(task)];
    const int first = size * task / kShares, count = size * (task + 1) / kShares - first;
    const std::span<const int> own =
        samples.subspan(static_cast<size_t>(first), static_cast<size_t>(count));
    share.inputs.resize(own.size() * static_cast<size_t>(observations_));
    share.outputs.resize(own.size());
    share.output_gradient.resize(own.size());
    for (int i = 0; i < count; ++i) {
      std::copy_n(observations.begin() + ptrdiff_t{own[static_cast<size_t>(i)]} * observations_,
                  observations_, share.inputs.begin() + ptrdiff_t{i} * observations_);
    }
    share.tape.Forward(copy.network, share.inputs.data(), count, share.outputs.data());
    for (size_t i = 0; i < own.size(); ++i) {
      const float error = share.outputs[i] - targets[static_cast<size_t>(own[i])];
      share.output_gradient[i] = 2 * error / static_cast<float>(size);
    }
    share.tape.Backward(copy.network, share.output_gradient.data(), gradients_.col(task).data());
  });
  const auto parameters = static_cast<int>(state_.parameters.size());
  if (shared)
    neighbours_.AllGather(gradients_.data(), static_cast<size_t>(parameters) * sizeof(float),
                          bounds_);
  ++state_.adam_steps;
  workers_->Run(kShares, [&](int task, int) {
    const int first = parameters * task / kShares,
              count = parameters * (task + 1) / kShares - first;
    kernels::AdamStep(count, state_.adam_steps, static_cast<float>(settings_.critic_rate), l2,
                      {gradients_.col(0).data() + first, gradients_.col(1).data() + first},
                      state_.parameters.data() + first, state_.first_moment.data() + first,
                      state_.second_moment.data() + first);
  });
}

bool Critic::Fit(std::span<const float> observations, std::span<const double> targets,
                 Random& random) {
  const CriticState before = state_;
  if (settings_.normalise_values) Rescale(targets);
  const double mean = state_.targets.mean, sd = state_.targets.sd();
  // Twice, as the gradient of the square; per sd^2, since the error is in that unit.
  const auto l2 = static_cast<float>(2 * settings_.critic_l2 / (sd * sd));

  std::vector<float> normalised(targets.size());
  std::transform(targets.begin(), targets.end(), normalised.begin(),
                 [&](double t) { return static_cast<float>((t - mean) / sd); });

  for (Copy& copy : copies_) copy.adam_steps = -1;
  std::vector<int> order(targets.size());
  std::iota(order.begin(), order.end(), 0);
  for (int epoch = 0; epoch < settings_.critic_epochs; ++epoch) {
    Shuffle(order, random);
    for (size_t first = 0; first < order.size();
         first += static_cast<size_t>(settings_.critic_minibatch)) {
      const size_t size =
          std::min(static_cast<size_t>(settings_.critic_minibatch), order.size() - first);
      Descend(observations, normalised, {&order[first], size}, l2);
    }
  }
  if (state_.parameters.allFinite() && state_.second_moment.allFinite()) return true;
  state_ = before;
  return false;
}

double ExplainedVariance(std::span<const double> values, std::span<const double> targets) {
  RunningMoments error, target;
  for (size_t i = 0; i < targets.size(); ++i) {
    error.Add(targets[i] - values[i]);
    target.Add(targets[i]);
  }
  return target.squares > 0 ? 1 - error.squares / target.squares : 0;
}

}  // namespace plumb
