#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <functional>
#include <memory>
#include <string>

namespace plumb {

/// How batches of simulations get done. A batch is a matrix whose columns are computed apart from each other; whoever does
/// them, the result has the same bits. Not thread-safe.
class Batches {
 public:
  /// Computes columns first ... first + count - 1 of a batch.
  using Columns = std::function<Eigen::MatrixXd(Eigen::Index first, Eigen::Index count)>;

  virtual ~Batches() = default;
  /// @param identity of what is computed: equal batches have equal ones. @return rows x columns.
  virtual Eigen::MatrixXd Run(uint64_t identity, Eigen::Index rows, Eigen::Index columns, const Columns& compute);
};

/// Whatever has been computed is kept in a file, and read back instead of being computed again: an inference that was killed
/// at any time, begun anew, goes through the same batches to the same bits. What follows the first batch that is not the
/// expected one, or is cut off, or damaged, is forgotten.
class JournaledBatches : public Batches {
 public:
  /// @param identity of the whole inference: a journal of another one is begun anew. @param inner computes; must outlive this.
  /// @throws std::runtime_error naming the file if it cannot be written.
  JournaledBatches(std::filesystem::path file, uint64_t identity, Batches& inner);

  Eigen::MatrixXd Run(uint64_t identity, Eigen::Index rows, Eigen::Index columns, const Columns& compute) override;

  /// Batches that had been computed before.
  int64_t resumed() const { return resumed_; }
  /// The inference is complete: removes the file.
  void Finish();

 private:
  bool Read(uint64_t identity, Eigen::MatrixXd* batch);

  std::filesystem::path file_;
  Batches& inner_;
  std::fstream stream_;
  bool reading_ = true;
  int64_t resumed_ = 0;
};

/// FNV-1a of bytes, from another hash on.
uint64_t Hash(const void* data, size_t size, uint64_t from = 0xcbf29ce484222325);
uint64_t Hash(const Eigen::MatrixXd& matrix, uint64_t from = 0xcbf29ce484222325);
uint64_t Hash(const std::string& text, uint64_t from = 0xcbf29ce484222325);

/// With how many threads, and by whom.
struct Workforce {
  Workforce(int thread_count = 1, Batches* done_by = nullptr) : threads(thread_count), batches(done_by) {}

  int threads;
  Batches* batches;  ///< null: here and now
};

}  // namespace plumb
