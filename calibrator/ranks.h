#pragma once

#include "calibrator/batches.h"

namespace plumb {

/// Several copies of a program, on one machine or many, that do each batch of simulations together: started with
/// `mpirun -n 4 plumb ...`. All of them run the same inference on the same data; rank 0 alone speaks and writes. Without mpirun,
/// or in a build without OpenMPI, there is one rank. Make one at most; not thread-safe.
class Ranks {
 public:
  /// Joins the others if mpirun has started this program. @throws std::runtime_error if it has and this build has no MPI.
  Ranks();
  ~Ranks();
  Ranks(const Ranks&) = delete;
  Ranks& operator=(const Ranks&) = delete;

  int rank() const { return rank_; }
  int size() const { return size_; }

 private:
  int rank_ = 0, size_ = 1;
  bool running_ = false;
};

/// Each rank computes some of the columns, and all get all of them.
class RankBatches : public Batches {
 public:
  /// @param journal of rank 0; null = none, and on the others.
  RankBatches(const Ranks& ranks, Journal* journal) : ranks_(ranks), journal_(journal) {}
  Eigen::MatrixXd Run(uint64_t identity, Eigen::Index rows, Eigen::Index columns, const Columns& compute) override;

 private:
  Eigen::MatrixXd Alone(uint64_t identity, Eigen::Index rows, Eigen::Index columns, const Columns& compute);

  const Ranks& ranks_;
  Journal* journal_;
};

}  // namespace plumb
