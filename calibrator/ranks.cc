#include "calibrator/ranks.h"

#include <cstdlib>
#include <stdexcept>
#include <vector>

#ifdef PLUMB_MPI
#define OMPI_SKIP_MPICXX 1
#include <mpi.h>
#endif

namespace plumb {

#ifdef PLUMB_MPI

Ranks::Ranks() {
  if (!std::getenv("OMPI_COMM_WORLD_SIZE")) return;  // MPI_Init alone takes a second
  MPI_Init(nullptr, nullptr);
  running_ = true;
  MPI_Comm_rank(MPI_COMM_WORLD, &rank_);
  MPI_Comm_size(MPI_COMM_WORLD, &size_);
}

Ranks::~Ranks() {
  if (running_) MPI_Finalize();
}

Eigen::MatrixXd RankBatches::Run(uint64_t identity, Eigen::Index rows, Eigen::Index columns, const Columns& compute) {
  if (ranks_.size() == 1) return Alone(identity, rows, columns, compute);
  Eigen::MatrixXd batch(rows, columns);
  int known = journal_ && journal_->Read(identity, &batch);
  MPI_Bcast(&known, 1, MPI_INT, 0, MPI_COMM_WORLD);
  MPI_Datatype column;  // counts are then columns: an int does for them
  MPI_Type_contiguous(static_cast<int>(rows), MPI_DOUBLE, &column);
  MPI_Type_commit(&column);
  if (known) {
    MPI_Bcast(batch.data(), static_cast<int>(columns), column, 0, MPI_COMM_WORLD);
  } else {
    std::vector<int> first, count;
    for (int r = 0; r < ranks_.size(); ++r) {
      const auto share = [&](int i) { return static_cast<int>(columns * i / ranks_.size()); };
      first.push_back(share(r));
      count.push_back(share(r + 1) - share(r));
    }
    const auto mine = static_cast<size_t>(ranks_.rank());
    if (count[mine] > 0) batch.middleCols(first[mine], count[mine]) = compute(first[mine], count[mine]);
    MPI_Allgatherv(MPI_IN_PLACE, 0, MPI_DATATYPE_NULL, batch.data(), count.data(), first.data(), column, MPI_COMM_WORLD);
    if (journal_) journal_->Append(identity, batch);
  }
  MPI_Type_free(&column);
  return batch;
}

#else

Ranks::Ranks() {
  if (std::getenv("OMPI_COMM_WORLD_SIZE")) {
    throw std::runtime_error("mpirun has started this, but it was built without OpenMPI: install libopenmpi-dev and build again");
  }
}

Ranks::~Ranks() = default;

Eigen::MatrixXd RankBatches::Run(uint64_t identity, Eigen::Index rows, Eigen::Index columns, const Columns& compute) {
  return Alone(identity, rows, columns, compute);
}

#endif

Eigen::MatrixXd RankBatches::Alone(uint64_t identity, Eigen::Index rows, Eigen::Index columns, const Columns& compute) {
  Eigen::MatrixXd batch(rows, columns);
  if (journal_ && journal_->Read(identity, &batch)) return batch;
  batch = Batches::Run(identity, rows, columns, compute);
  if (journal_) journal_->Append(identity, batch);
  return batch;
}

}  // namespace plumb
