#include "common/rank_batch_runner.h"

#include <algorithm>
#include <span>
#include <vector>

namespace plumb {
namespace {

// Simulators go through a processor eight at a time, and matrices are multiplied four columns at a
// time: so many stay together, whoever has them, or their last bits might not be the same.
constexpr Eigen::Index kTogether = 8;

std::vector<int> Bounds(const Ranks& ranks, Eigen::Index columns) {
  std::vector<int> bounds = ranks.Bounds(static_cast<int>((columns + kTogether - 1) / kTogether));
  for (int& bound : bounds)
    bound = static_cast<int>(std::min<Eigen::Index>(bound * kTogether, columns));
  return bounds;
}

}  // namespace

Eigen::MatrixXd RankBatchRunner::Run(uint64_t identity, Eigen::Index rows, Eigen::Index columns,
                                     const Columns& compute) {
  Eigen::MatrixXd batch(rows, columns);
  bool known = journal_ && journal_->Read(identity, &batch);
  ranks_.Broadcast(std::as_writable_bytes(std::span(&known, 1)));
  if (known) {
    ranks_.Broadcast(
        std::as_writable_bytes(std::span(batch.data(), static_cast<size_t>(batch.size()))));
    return batch;
  }
  const std::vector<int> bounds = Bounds(ranks_, columns);
  const auto rank = static_cast<size_t>(ranks_.rank());
  const Eigen::Index first = bounds[rank], count = bounds[rank + 1] - first;
  if (count > 0) {
    batch.middleCols(first, count) = BatchRunner::Run(
        identity, rows, count, [&](Eigen::Index, Eigen::Index) { return compute(first, count); });
  }
  ranks_.AllGather(batch.data(), static_cast<size_t>(rows) * sizeof(double), bounds);
  if (journal_) journal_->Append(identity, batch);
  return batch;
}

}  // namespace plumb
