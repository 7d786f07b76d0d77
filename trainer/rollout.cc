#include "trainer/rollout.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <stdexcept>

#include "common/shares.h"
#include "common/special_numbers.h"
#include "controller/trial.h"

namespace plumb {
namespace {

// Episodes side by side: the kernels gain little from more columns, simulators nothing.
constexpr int kMaxTogether = 8;
// Episodes after which a batch may be given up, as nearly all of them were dropped.
constexpr int kFewestJudged = 40;

// A session has let in distributions of which half of a sample can be simulated: of a few episodes
// most may break, and nothing that was let in is to end a trainer.
void RequireUsable(const Batch& batch) {
  if (10 * batch.dropped <= 9 * batch.played || batch.played < kFewestJudged) return;
  throw std::runtime_error(
      fmt::format("{} of {} simulated episodes were not finite or had impossible parameters: "
                  "nothing to learn from",
                  batch.dropped, batch.played));
}

// The numbers of those of lowest return, ascending.
std::vector<size_t> Worst(const std::vector<EpisodeRecord>& records, double share) {
  std::vector<size_t> kept(records.size());
  std::iota(kept.begin(), kept.end(), 0);
  if (share >= 1) return kept;
  std::stable_sort(kept.begin(), kept.end(),
                   [&](size_t a, size_t b) { return records[a].sum < records[b].sum; });
  kept.resize(static_cast<size_t>(std::ceil(share * static_cast<double>(records.size()))));
  std::sort(kept.begin(), kept.end());
  return kept;
}

void Append(const EpisodeRecord& record, Batch* batch) {
  const auto append = [](const auto& from, auto* to) {
    to->insert(to->end(), from.begin(), from.end());
  };
  const int begin = batch->size();
  append(record.observations, &batch->observations);
  append(record.actions, &batch->actions);
  append(record.rewards, &batch->rewards);
  append(record.final_observation, &batch->final_observations);
  batch->episodes.push_back({begin, batch->size(), record.terminated});
}

}  // namespace

/// Plays one episode at a time, in its own simulation.
struct RolloutSampler::Player {
  std::unique_ptr<Simulation> simulation;
  Eigen::VectorXf raw;
  Random random{0};
  EpisodeRecord* record = nullptr;  // null: has nothing to play

  void Begin(const ParameterSampler& sample, Random own, EpisodeRecord& episode) {
    random = own;
    record = &episode;
    try {
      simulation->Reset(sample(random), random);
    } catch (const std::invalid_argument&) {
      record = nullptr;
    }
  }

  /// Writes the network's input. Ends the episode if it is over, or not finite and of no use.
  void Observe(const GaussianPolicy& policy, bool explore, float* observation) {
    simulation->Observe(raw);
    const Eigen::VectorXf normalised = policy.Normalize(raw);
    if (!raw.allFinite() || !normalised.allFinite() || !std::isfinite(record->sum)) {
      record = nullptr;
      return;
    }
    if (explore) record->moments.Add(raw);
    if (record->terminated || record->steps() == simulation->steps_per_episode()) {
      record->final_observation = normalised;
      record->usable = true;
      record = nullptr;
      return;
    }
    std::copy(normalised.begin(), normalised.end(), observation);
  }

  /// @param action the mean in, what is to be done out; not finite: the episode is of no use.
  void Choose(Eigen::Ref<Eigen::VectorXf> action, const Eigen::ArrayXf& sd, bool explore) {
    if (explore) {
      for (Eigen::Index a = 0; a < action.size(); ++a)
        action[a] += sd[a] * static_cast<float>(random.Normal());
    }
    if (!action.allFinite()) record = nullptr;
  }

  /// Takes down a step that was done.
  void Record(const float* observation, const Simulation::Move& move, bool explore) {
    record->rewards.push_back(move.result.reward);
    record->sum += move.result.reward;
    record->terminated = move.result.terminated;
    if (!explore) return;
    record->observations.insert(record->observations.end(), observation, observation + raw.size());
    record->actions.insert(record->actions.end(), move.action.begin(), move.action.end());
  }
};

/// The work space of one thread.
struct RolloutSampler::Worker {
  std::vector<Player> players;
  kernels::Tape tape;
  Eigen::MatrixXf observations, actions;  // a column for each episode under way
  std::vector<Simulation::Move> moves;    // likewise

  /// @param begin gives a player an episode. Plays `count` of them in lock-step.
  void Play(const GaussianPolicy& policy, const kernels::Network& network, int count, bool explore,
            const std::function<void(int, Player&)>& begin);
};

void RolloutSampler::Worker::Play(const GaussianPolicy& policy, const kernels::Network& network,
                                  int count, bool explore,
                                  const std::function<void(int, Player&)>& begin) {
  const Eigen::ArrayXf sd = policy.log_std().array().exp();
  std::vector<Player*> playing;
  for (int i = 0; i < count; ++i) {
    Player& player = players[static_cast<size_t>(i)];
    begin(i, player);
    playing.push_back(&player);
  }
  while (!playing.empty()) {
    std::erase_if(playing, [](const Player* player) { return player->record == nullptr; });
    int column = 0;
    for (Player* player : playing) {
      player->Observe(policy, explore, observations.col(column).data());
      column += player->record != nullptr;
    }
    std::erase_if(playing, [](const Player* player) { return player->record == nullptr; });
    if (playing.empty()) return;
    tape.Forward(network, observations.data(), column, actions.data());
    moves.clear();
    for (column = 0; column < static_cast<int>(playing.size()); ++column) {
      Player& player = *playing[static_cast<size_t>(column)];
      player.Choose(actions.col(column), sd, explore);
      if (!player.record) continue;
      moves.push_back({player.simulation.get(), {actions.col(column).data(), actions.rows()}});
    }
    players.front().simulation->StepTogether(moves);
    size_t done = 0;
    for (column = 0; column < static_cast<int>(playing.size()); ++column) {
      Player& player = *playing[static_cast<size_t>(column)];
      if (player.record) player.Record(observations.col(column).data(), moves[done++], explore);
    }
  }
}

RolloutSampler::RolloutSampler(const SimulationFactory& make, const PolicyShape& shape,
                               Workers& workers, const Ranks& ranks)
    : workers_(&workers), ranks_(&ranks), network_(shape.sizes()) {
  for (int i = 0; i < workers.size(); ++i) {
    auto worker = std::make_unique<Worker>(Worker{{},
                                                  kernels::Tape(shape.sizes(), kMaxTogether),
                                                  Eigen::MatrixXf(shape.observations, kMaxTogether),
                                                  Eigen::MatrixXf(shape.actions, kMaxTogether),
                                                  {}});
    for (int k = 0; k < kMaxTogether; ++k) {
      worker->players.push_back({.simulation = make(), .raw = Eigen::VectorXf(shape.observations)});
    }
    state_.push_back(std::move(worker));
  }
  time_limit_ = state_.front()->players.front().simulation->steps_per_episode();
}

RolloutSampler::~RolloutSampler() = default;

std::vector<EpisodeRecord> RolloutSampler::Run(const GaussianPolicy& policy,
                                               const ParameterSampler& sample, int first, int count,
                                               bool explore, uint64_t seed, uint32_t stream,
                                               uint32_t number) {
  network_.Set({policy.parameters.data(), static_cast<size_t>(policy.parameters.size())});
  const std::vector<int> bounds = ranks_->Bounds(count);
  const auto rank = static_cast<size_t>(ranks_->rank());
  const int own = bounds[rank + 1] - bounds[rank];
  first += bounds[rank];
  std::vector<EpisodeRecord> records(static_cast<size_t>(own));
  // Full ones, in a number that the threads share evenly.
  const int threads = workers_->size();
  int tasks = (own + kMaxTogether - 1) / kMaxTogether;
  tasks = std::min(own, (tasks + threads - 1) / threads * threads);
  workers_->Run(tasks, [&](int task, int worker) {
    const int begin = ShareBegin(own, task, tasks), end = ShareBegin(own, task + 1, tasks);
    state_[static_cast<size_t>(worker)]->Play(
        policy, network_, end - begin, explore, [&](int i, Player& player) {
          const int episode = begin + i;
          player.Begin(sample,
                       Random(seed, {stream, number, static_cast<uint32_t>(first + episode)}),
                       records[static_cast<size_t>(episode)]);
        });
  });
  return Gather(*ranks_, std::move(records));
}

Batch RolloutSampler::Collect(const GaussianPolicy& policy, const ParameterSampler& sample,
                              int steps, double worst_share, uint64_t seed, uint32_t stream,
                              uint32_t number) {
  Batch batch;
  std::vector<EpisodeRecord> records;
  std::vector<size_t> kept;  // of the records, by number
  int kept_steps = 0;
  double sum = 0;
  while (kept_steps < steps) {
    // As many episodes as are missing if they last as long as those so far: known before they are
    // played, so that the number of threads cannot matter.
    const double length =
        kept.empty() ? time_limit_ : 1. * kept_steps / static_cast<double>(kept.size());
    const int wanted = static_cast<int>(std::ceil((steps - kept_steps) / length / worst_share));
    for (EpisodeRecord& record :
         Run(policy, sample, batch.played, wanted, true, seed, stream, number)) {
      if (!record.usable) {
        ++batch.dropped;
        continue;
      }
      batch.moments.Merge(record.moments);
      batch.steps += record.steps();
      sum += record.sum;
      records.push_back(std::move(record));
    }
    batch.played += wanted;
    RequireUsable(batch);
    kept = Worst(records, worst_share);
    kept_steps = 0;
    for (const size_t i : kept) kept_steps += records[i].steps();
  }
  for (const size_t i : kept) Append(records[i], &batch);
  batch.mean_return = sum / static_cast<double>(records.size());
  return batch;
}

std::vector<double> RolloutSampler::Returns(const GaussianPolicy& policy,
                                            const ParameterSampler& sample, int episodes,
                                            uint64_t seed, uint32_t stream, uint32_t number) {
  std::vector<double> returns;
  for (const EpisodeRecord& record :
       Run(policy, sample, 0, episodes, false, seed, stream, number)) {
    returns.push_back(record.usable ? record.sum : kNaN);
  }
  return returns;
}

std::vector<double> RolloutSampler::TrialReturns(const GaussianPolicy& policy,
                                                 const ParameterSampler& sample, int trial_steps,
                                                 int episodes, uint64_t seed, uint32_t stream,
                                                 uint32_t number) {
  std::vector<double> returns;
  for (const EpisodeRecord& record :
       Run(policy, sample, 0, episodes, false, seed, stream, number)) {
    Trial trial;
    for (int i = 0; i < std::min(trial_steps, record.steps()); ++i)
      trial.Add(record.rewards[static_cast<size_t>(i)], trial_steps);
    const bool whole = record.usable && !record.terminated;
    returns.push_back(whole ? trial.WholeReturn(record.steps()) : kNaN);
  }
  return returns;
}

}  // namespace plumb
