#include "chaos/journal_witness.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <fstream>
#include <iterator>
#include <optional>
#include <set>
#include <utility>

#include "calibrator/live/calibrator.h"
#include "calibrator/live/checkpoint.h"
#include "calibrator/results/posterior_file.h"
#include "chaos/expected_transitions.h"
#include "common/message_bytes.h"

namespace plumb {
namespace {

using Episode = ExpectedTransitions::Episode;

std::vector<double> List(const Eigen::VectorXd& x) { return {x.begin(), x.end()}; }

Episode StepsOf(const Rollout& rollout) {
  Episode steps;
  for (const Transition& t : rollout.transitions)
    steps.push_back({t.step, List(t.q), List(t.v), List(t.next_q), List(t.next_v)});
  return steps;
}

std::string Contents(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

}  // namespace

void JournalWitness::OnHeard(const lockstep_post_t& post) {
  if (!lives_.empty()) lives_.back().heard.push_back(post);
}

int JournalWitness::Judge(int64_t time, const std::filesystem::path& folder, uint64_t seed,
                          const MessageWitness& said) {
  std::optional<SimOpt::State> journal;
  try {
    journal = CalibrationCheckpoint(folder, robot_, seed).Load();
  } catch (const std::exception& error) {
    chronicle_.Violate(4, time, error.what());
    return 0;
  }
  const int iterations = journal ? journal->iteration : 0;
  if (iterations < said.iteration()) {
    chronicle_.Violate(4, time,
                       fmt::format("distribution {} was said, the journal has {} iterations",
                                   said.iteration(), iterations));
  }
  if (!journal) return 0;
  JudgeRollouts(time, *journal);
  JudgeFindings(time, folder, seed, *journal, said);
  return static_cast<int>(CountTransitions(journal->rollouts));
}

void JournalWitness::JudgeRollouts(int64_t time, const SimOpt::State& journal) {
  std::map<int64_t, std::vector<Episode>> expected;
  std::map<int, std::set<std::vector<int64_t>>> completed;
  for (Life& life : lives_) {
    std::ranges::stable_sort(life.heard, {}, &lockstep_post_t::arrival);
    ExpectedTransitions transitions(robot_, bus_, key_, life.beginning);
    for (const lockstep_post_t& post : life.heard) transitions.Hear(post);
    for (const auto& [episode, seen] : transitions.episodes())
      std::ranges::copy(seen, std::back_inserter(expected[episode]));
    for (const auto& [policy, lists] : transitions.completed())
      completed[policy].insert(lists.begin(), lists.end());
  }
  std::set<int64_t> counted;
  for (const Rollout& rollout : journal.rollouts) {
    if (!counted.insert(rollout.episode).second) {
      chronicle_.Violate(4, time, fmt::format("episode {} counts twice", rollout.episode));
      continue;
    }
    const std::vector<Episode>& known = expected[rollout.episode];
    const Episode steps = StepsOf(rollout);
    if (std::ranges::find(known, steps) != known.end()) continue;
    const std::string told =
        known.empty() ? "it was not told of it" : fmt::format("it was told {}", known[0].size());
    chronicle_.Violate(4, time,
                       fmt::format("{} transitions of episode {} count, and {}", steps.size(),
                                   rollout.episode, told));
  }
  // None of a policy's episodes is missing.
  auto rollout = journal.rollouts.begin();
  for (int policy = 0; policy < journal.iteration; ++policy) {
    const int count = journal.rollouts_per_iteration[static_cast<size_t>(policy)];
    std::vector<int64_t> episodes(static_cast<size_t>(count));
    for (int64_t& episode : episodes) episode = (rollout++)->episode;
    if (completed[policy].contains(episodes)) continue;
    chronicle_.Violate(4, time,
                       fmt::format("of policy {} the episodes {} count, which are not those that "
                                   "it was told",
                                   policy, fmt::join(episodes, ", ")));
  }
}

/// The same transitions again, by a calibrator whom nobody disturbs.
void JournalWitness::JudgeFindings(int64_t time, const std::filesystem::path& folder, uint64_t seed,
                                   const SimOpt::State& journal, const MessageWitness& said) {
  SimOpt again(robot_, seed, 1, robot_.calibration.method);
  auto next = journal.rollouts.begin();
  size_t in_use = 0;
  for (int k = 1; k <= journal.iteration; ++k) {
    const auto end = next + journal.rollouts_per_iteration[static_cast<size_t>(k - 1)];
    std::vector<Rollout> rollouts(next, end);
    next = end;
    in_use += CountTransitions(rollouts);
    again.Begin(std::move(rollouts));
    std::optional<CalibrationReport> report;
    while (again.running()) report = again.Update();
    const std::string posterior =
        PosteriorJson(IterationFindings(robot_, again, *report), robot_, {});
    if (Contents(folder / fmt::format("posterior_{}.json", k)) != posterior)
      chronicle_.Violate(5, time, fmt::format("posterior {} is another", k));
    const auto distribution = said.distributions().find(k);
    if (distribution != said.distributions().end() &&
        distribution->second != Encode(DistributionMessage(robot_, again.state(), seed, &*report)))
      chronicle_.Violate(5, time, fmt::format("distribution {} is another", k));
    const auto counted_then = said.transitions().find(k);
    if (counted_then != said.transitions().end() &&
        static_cast<size_t>(counted_then->second) != in_use) {
      chronicle_.Violate(4, time,
                         fmt::format("{} transitions in use after iteration {}, {} in the "
                                     "journal",
                                     counted_then->second, k, in_use));
    }
  }
}

}  // namespace plumb
