#include "common/batch_runner.h"

#include <array>
#include <stdexcept>

#include "common/hash.h"

namespace plumb {
namespace {

constexpr uint64_t kMagic = 0x504c554d424a3031;  // "PLUMBJ01"

// In front of each batch; its check covers these numbers and the batch.
struct Header {
  uint64_t identity;
  int64_t rows, columns;
  uint64_t check;
};

uint64_t CheckOf(const Header& header, const Eigen::MatrixXd& batch) {
  return Hash(batch, Hash(&header, offsetof(Header, check)));
}

}  // namespace

Eigen::MatrixXd BatchRunner::Run(uint64_t, Eigen::Index rows, Eigen::Index columns,
                                 const Columns& compute) {
  Eigen::MatrixXd batch = compute(0, columns);
  if (batch.rows() != rows || batch.cols() != columns)
    throw std::logic_error("a batch has another size than was announced");
  return batch;
}

Journal::Journal(std::filesystem::path file, uint64_t identity) : file_(std::move(file)) {
  std::array<uint64_t, 2> head{};
  stream_.open(file_, std::ios::in | std::ios::out | std::ios::binary);
  const bool same = stream_ && stream_.read(reinterpret_cast<char*>(head.data()), sizeof head) &&
                    head[0] == kMagic && head[1] == identity;
  if (same) return;
  reading_ = false;
  stream_ = std::fstream(file_, std::ios::in | std::ios::out | std::ios::binary | std::ios::trunc);
  head = {kMagic, identity};
  stream_.write(reinterpret_cast<const char*>(head.data()), sizeof head);
  stream_.flush();
  if (!stream_) throw std::runtime_error(file_.string() + ": cannot be written");
}

bool Journal::Read(uint64_t identity, Eigen::MatrixXd* batch) {
  if (!reading_) return false;
  const auto begin = stream_.tellg();
  Header header{};
  const bool expected = stream_.read(reinterpret_cast<char*>(&header), sizeof header) &&
                        header.identity == identity && header.rows == batch->rows() &&
                        header.columns == batch->cols();
  if (expected &&
      stream_.read(
          reinterpret_cast<char*>(batch->data()),
          static_cast<std::streamsize>(static_cast<size_t>(batch->size()) * sizeof(double))) &&
      header.check == CheckOf(header, *batch)) {
    ++resumed_;
    return true;
  }
  stream_.clear();
  std::filesystem::resize_file(file_, static_cast<uintmax_t>(begin));
  stream_.seekp(begin);
  reading_ = false;
  return false;
}

void Journal::Append(uint64_t identity, const Eigen::MatrixXd& batch) {
  Header header{identity, batch.rows(), batch.cols(), 0};
  header.check = CheckOf(header, batch);
  stream_.write(reinterpret_cast<const char*>(&header), sizeof header);
  stream_.write(reinterpret_cast<const char*>(batch.data()),
                static_cast<std::streamsize>(static_cast<size_t>(batch.size()) * sizeof(double)));
  stream_.flush();
  if (!stream_) throw std::runtime_error(file_.string() + ": cannot be written");
}

void Journal::Finish() {
  stream_.close();
  std::filesystem::remove(file_);
}

}  // namespace plumb
