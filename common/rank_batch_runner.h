#pragma once

#include "common/batch_runner.h"
#include "common/ranks.h"

namespace plumb {

/// Each rank computes some of the columns, and all get all of them. Not thread-safe.
class RankBatchRunner : public BatchRunner {
 public:
  /// @param ranks must outlive this. @param journal of rank 0; null = none, and on the others.
  RankBatchRunner(const Ranks& ranks, Journal* journal) : ranks_(ranks), journal_(journal) {}
  Eigen::MatrixXd Run(uint64_t identity, Eigen::Index rows, Eigen::Index columns,
                      const Columns& compute) override;

 private:
  const Ranks& ranks_;
  Journal* journal_;
};

}  // namespace plumb
