#include "common/batch_runner.h"

#include <fcntl.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <stdexcept>

#include "common/hash.h"

namespace plumb {
namespace {

constexpr uint64_t kJournalMagic = 0x504c554d424a3031;  // "PLUMBJ01"

// In front of each batch; its check covers these numbers and the batch.
struct Header {
  uint64_t identity;
  int64_t rows, columns;
  uint64_t check;
};

uint64_t CheckOf(const Header& header, const Eigen::MatrixXd& batch) {
  return Hash(batch, Hash(&header, offsetof(Header, check)));
}

// A journal, or what a killed process has left of its first bytes; else a new file. What is
// somebody else's, or a link to it, is not written over.
class Opened {
 public:
  explicit Opened(const std::filesystem::path& file)
      : fd_(open(file.c_str(), O_RDWR | O_CREAT | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC, 0644)) {
    if (fd_ < 0 && errno == ELOOP) Fail(file, "is a link: a journal is not written through one");
    if (fd_ < 0) Fail(file, std::string("cannot be written: ") + std::strerror(errno));
    std::array<char, sizeof kJournalMagic> begin{};
    const ssize_t size = pread(fd_, begin.data(), begin.size(), 0);
    if (size < 0 || std::memcmp(begin.data(), &kJournalMagic, static_cast<size_t>(size)) != 0)
      Fail(file, "is in the way and no journal: it is not written over");
  }
  ~Opened() {
    if (fd_ >= 0) close(fd_);
  }
  Opened(const Opened&) = delete;
  Opened& operator=(const Opened&) = delete;

  /// A name of this very file, whatever becomes of its own.
  std::string name() const { return "/proc/self/fd/" + std::to_string(fd_); }

 private:
  [[noreturn]] void Fail(const std::filesystem::path& file, const std::string& why) {
    if (fd_ >= 0) close(fd_);
    throw std::runtime_error(file.string() + ": " + why);
  }
  int fd_;
};

}  // namespace

Eigen::MatrixXd BatchRunner::Run(uint64_t, Eigen::Index rows, Eigen::Index columns,
                                 const Columns& compute) {
  Eigen::MatrixXd batch = compute(0, columns);
  if (batch.rows() != rows || batch.cols() != columns)
    throw std::logic_error("a batch has another size than was announced");
  return batch;
}

Journal::Journal(std::filesystem::path file, uint64_t identity) : file_(std::move(file)) {
  const Opened opened(file_);
  std::array<uint64_t, 2> head{};
  stream_.open(opened.name(), std::ios::in | std::ios::out | std::ios::binary);
  const bool same = stream_ && stream_.read(reinterpret_cast<char*>(head.data()), sizeof head) &&
                    head[0] == kJournalMagic && head[1] == identity;
  if (same) return;
  reading_ = false;
  stream_ = std::fstream(opened.name(),
                         std::ios::in | std::ios::out | std::ios::binary | std::ios::trunc);
  head = {kJournalMagic, identity};
  stream_.write(reinterpret_cast<const char*>(head.data()), sizeof head);
  stream_.flush();
  RequireWritten();
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

void Journal::RequireWritten() const {
  if (!stream_)
    throw std::runtime_error(file_.string() + ": cannot be written: " + std::strerror(errno));
}

void Journal::Append(uint64_t identity, const Eigen::MatrixXd& batch) {
  Header header{identity, batch.rows(), batch.cols(), 0};
  header.check = CheckOf(header, batch);
  stream_.write(reinterpret_cast<const char*>(&header), sizeof header);
  stream_.write(reinterpret_cast<const char*>(batch.data()),
                static_cast<std::streamsize>(static_cast<size_t>(batch.size()) * sizeof(double)));
  stream_.flush();
  RequireWritten();
}

void Journal::Finish() {
  stream_.close();
  std::filesystem::remove(file_);
}

}  // namespace plumb
