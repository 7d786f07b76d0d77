#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <functional>
#include <memory>
#include <string>

namespace plumb {

/// How batches of simulations get done. A batch is a matrix whose columns are computed apart from
/// each other; whoever does them, the result has the same bits. Not thread-safe.
class BatchRunner {
 public:
  /// Computes columns first ... first + count - 1 of a batch.
  using Columns = std::function<Eigen::MatrixXd(Eigen::Index first, Eigen::Index count)>;

  virtual ~BatchRunner() = default;
  /// @param identity of what is computed: equal batches have equal ones. @return rows x columns.
  virtual Eigen::MatrixXd Run(uint64_t identity, Eigen::Index rows, Eigen::Index columns,
                              const Columns& compute);
};

/// Batches that have been computed, in a file: an inference that was killed at any time, begun
/// anew, goes through the same batches to the same bits, and needs not compute those again. What
/// follows the first batch that is not the expected one, or is cut off, or damaged, is forgotten.
/// Not thread-safe.
class Journal {
 public:
  /// @param identity of the whole inference: a journal of another one is begun anew.
  /// @throws std::runtime_error naming the file if it cannot be written.
  Journal(std::filesystem::path file, uint64_t identity);

  /// The next batch, if it has been computed before: `batch` has its size. @return false if it has
  /// not.
  bool Read(uint64_t identity, Eigen::MatrixXd* batch);
  /// @throws std::runtime_error naming the file if it cannot be written.
  void Append(uint64_t identity, const Eigen::MatrixXd& batch);
  /// Batches that had been computed before.
  int64_t resumed() const { return resumed_; }
  /// The inference is complete: removes the file.
  void Finish();

 private:
  void RequireWritten() const;

  std::filesystem::path file_;
  std::fstream stream_;
  bool reading_ = true;
  int64_t resumed_ = 0;
};

/// With how many threads, and by whom.
struct ExecutionOptions {
  ExecutionOptions(int thread_count = 1, BatchRunner* done_by = nullptr)
      : threads(thread_count), batches(done_by) {}

  int threads;
  BatchRunner* batches;  ///< null: here and now
};

}  // namespace plumb
