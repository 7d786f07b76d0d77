#include "calibrator/diagnostics/witnesses.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <utility>

#include "calibrator/fit/recorded_window.h"
#include "calibrator/fit/whitening.h"
#include "common/decompositions.h"
#include "common/gaussian.h"
#include "common/random.h"

namespace plumb {
namespace {

constexpr int kFewestPairs = 12;  // of points, for each transition
constexpr uint64_t kSeed = 1;     // of the axes' directions

// Of each transition that the rows speak of: its first row, and the end.
std::vector<std::pair<size_t, size_t>> BlocksOf(std::span<const WindowErrors::Row> rows) {
  std::vector<std::pair<size_t, size_t>> blocks;
  for (size_t first = 0; first < rows.size();) {
    size_t end = first;
    while (end < rows.size() && rows[end].rollout == rows[first].rollout &&
           rows[end].transition == rows[first].transition) {
      ++end;
    }
    blocks.emplace_back(first, end);
    first = end;
  }
  return blocks;
}

using Index = std::map<std::pair<int, int>, Eigen::Index>;

Index IndexOf(const OneStep& step) {
  Index index;
  for (const OneStep::Step& one : step.steps())
    index.emplace(std::pair(one.rollout, one.transition), static_cast<Eigen::Index>(index.size()));
  return index;
}

// Directions of a transition's pairs, whitened: each turn's are orthogonal, and sqrt(2 n) long.
Eigen::MatrixXd Directions(Eigen::Index size, int turns, Eigen::Index transition) {
  Random random(kSeed, {0xbe4d, static_cast<uint32_t>(transition)});
  Eigen::MatrixXd directions(size, size * turns);
  for (int turn = 0; turn < turns; ++turn) {
    const Eigen::HouseholderQR<Eigen::MatrixXd> qr(StandardNormals(size, size, random));
    directions.middleCols(turn * size, size) =
        std::sqrt(static_cast<double>(size)) * FirstColumns(qr.householderQ(), size);
  }
  return directions;
}

Eigen::MatrixXd StartSds(const OneStep& step, const Eigen::VectorXd& noise_sd) {
  Eigen::MatrixXd sds(noise_sd.size(), static_cast<Eigen::Index>(step.steps().size()));
  for (size_t i = 0; i < step.steps().size(); ++i) {
    sds.col(static_cast<Eigen::Index>(i)) = StartSd(*step.steps()[i].recorded, noise_sd);
  }
  return sds;
}

// How the end of each transition depends on its beginning, in standard deviations of the
// beginning's noise.
struct Expansion {
  Eigen::Index pairs;  // of points
  std::vector<Eigen::MatrixXd> slope;
  std::vector<Eigen::MatrixXd> bend;  // a column for each pair
};

Expansion Expand(OneStep& step, const Eigen::VectorXd& physical, const Eigen::VectorXd& noise_sd) {
  const Eigen::Index size = noise_sd.size();
  const auto count = static_cast<Eigen::Index>(step.steps().size());
  const auto turns = static_cast<int>((kFewestPairs + size - 1) / size);
  const Eigen::MatrixXd starts = step.Starts(), sds = StartSds(step, noise_sd);
  const Eigen::MatrixXd middle = step.Predict(physical, starts);
  std::vector<Eigen::MatrixXd> directions;
  directions.reserve(step.steps().size());
  for (Eigen::Index k = 0; k < count; ++k) directions.push_back(Directions(size, turns, k));
  const Eigen::Index pairs = size * turns;
  std::vector<Eigen::MatrixXd> slope(step.steps().size(), Eigen::MatrixXd::Zero(size, size)),
      bend(step.steps().size(), Eigen::MatrixXd(size, pairs));
  for (Eigen::Index pair = 0; pair < pairs; ++pair) {
    Eigen::MatrixXd offset(size, count);
    for (Eigen::Index k = 0; k < count; ++k)
      offset.col(k) = sds.col(k).cwiseProduct(directions[static_cast<size_t>(k)].col(pair));
    const Eigen::MatrixXd above = step.Predict(physical, starts + offset),
                          below = step.Predict(physical, starts - offset);
    for (Eigen::Index k = 0; k < count; ++k) {
      const auto at = static_cast<size_t>(k);
      slope[at] += (above.col(k) - below.col(k)) * directions[at].col(pair).transpose() /
                   (2 * static_cast<double>(pairs));
      bend[at].col(pair) = (above.col(k) + below.col(k)) / 2 - middle.col(k);
    }
  }
  return {pairs, std::move(slope), std::move(bend)};
}

}  // namespace

Witnesses::Witnesses(OneStep& step, std::span<const WindowErrors::Row> rows,
                     const Eigen::VectorXd& physical, const Eigen::VectorXd& noise_sd) {
  const Expansion near = Expand(step, physical, noise_sd);
  const Eigen::Index size = noise_sd.size();
  const Index index = IndexOf(step);
  for (const auto& [first, end] : BlocksOf(rows)) {
    const Eigen::Index k = index.at({rows[first].rollout, rows[first].transition});
    const Transition& recorded = *step.steps()[static_cast<size_t>(k)].recorded;
    const auto height = static_cast<Eigen::Index>(end - first);
    Block block{static_cast<Eigen::Index>(first), height, Eigen::MatrixXd(height, size),
                Eigen::VectorXd::Ones(size), Eigen::VectorXd(height)};
    Eigen::MatrixXd bends(height, near.pairs);
    std::vector<int> coordinates;
    for (Eigen::Index i = 0; i < height; ++i) {
      const int c = rows[first + static_cast<size_t>(i)].coordinate;
      coordinates.push_back(c);
      block.end_sd(i) = EndSd(recorded, c, noise_sd);
      block.sensitivity.row(i) = near.slope[static_cast<size_t>(k)].row(c);
      bends.row(i) = near.bend[static_cast<size_t>(k)].row(c);
    }
    if (!block.sensitivity.allFinite() || !bends.allFinite()) continue;
    AddDisturbance(recorded, coordinates, &block.start_sd, &block.sensitivity);
    const std::vector<Eigen::Index> steps{0, height};
    WhitenWindow(steps, block.start_sd, block.sensitivity, block.end_sd, bends);
    if (bends.rowwise().squaredNorm().maxCoeff() >
        kLargestBend * kLargestBend * static_cast<double>(near.pairs)) {
      continue;
    }
    blocks_.push_back(std::move(block));
    rows_.insert(rows_.end(), rows.begin() + static_cast<std::ptrdiff_t>(first),
                 rows.begin() + static_cast<std::ptrdiff_t>(end));
  }
}

Eigen::MatrixXd Witnesses::Whiten(const Eigen::MatrixXd& raw) const {
  Eigen::MatrixXd whitened(static_cast<Eigen::Index>(rows_.size()), raw.cols());
  Eigen::Index at = 0;
  for (const Block& block : blocks_) {
    auto part = whitened.middleRows(at, block.count);
    part = raw.middleRows(block.first, block.count);
    const std::vector<Eigen::Index> steps{0, block.count};
    WhitenWindow(steps, block.start_sd, block.sensitivity, block.end_sd, part);
    at += block.count;
  }
  return whitened;
}

Eigen::MatrixXd PredictStarts(OneStep& step, const Eigen::VectorXd& physical) {
  Eigen::MatrixXd starts = step.Starts();
  const Eigen::MatrixXd led_to = step.Predict(physical, starts);
  for (Eigen::Index k = 1; k < starts.cols(); ++k) {
    if (step.steps()[static_cast<size_t>(k)].goes_on && led_to.col(k - 1).allFinite())
      starts.col(k) = led_to.col(k - 1);
  }
  return starts;
}

Eigen::MatrixXd PredictRows(OneStep& step, std::span<const WindowErrors::Row> rows,
                            const Eigen::MatrixXd& physical, const Eigen::MatrixXd& starts) {
  const Index index = IndexOf(step);
  Eigen::MatrixXd predicted(static_cast<Eigen::Index>(rows.size()), physical.cols());
  for (Eigen::Index s = 0; s < physical.cols(); ++s) {
    const Eigen::MatrixXd ends = step.Predict(physical.col(s), starts);
    for (size_t i = 0; i < rows.size(); ++i) {
      predicted(static_cast<Eigen::Index>(i), s) =
          ends(rows[i].coordinate, index.at({rows[i].rollout, rows[i].transition}));
    }
  }
  return predicted;
}

std::vector<Whereabouts> FindWhereabouts(OneStep& step, std::span<const WindowErrors::Row> rows,
                                         const Eigen::VectorXd& physical,
                                         const Eigen::MatrixXd& starts) {
  const Eigen::MatrixXd ends = step.Predict(physical, starts);
  const Index index = IndexOf(step);
  std::vector<Whereabouts> all;
  for (const auto& [first, last] : BlocksOf(rows)) {
    const Eigen::Index k = index.at({rows[first].rollout, rows[first].transition});
    const auto at = static_cast<size_t>(k);
    all.push_back({step.StartPositions(at, starts.col(k)),
                   starts.col(k).tail(step.num_velocities()), step.EndPositions(at, ends.col(k))});
  }
  return all;
}

}  // namespace plumb
