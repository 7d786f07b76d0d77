#include "common/ranks.h"

#include <algorithm>
#include <climits>
#include <cstdint>
#include <cstdlib>
#include <exception>
#include <numeric>
#include <stdexcept>
#include <utility>

#ifdef PLUMB_MPI
#define OMPI_SKIP_MPICXX 1
#include <mpi.h>
#endif

#include "common/shares.h"

namespace plumb {
namespace {

bool StartedByMpirun() { return std::getenv("OMPI_COMM_WORLD_SIZE") != nullptr; }

#ifdef PLUMB_MPI
std::vector<int> Displacements(std::span<const int> counts) {
  std::vector<int> displacements(counts.size());
  std::exclusive_scan(counts.begin(), counts.end(), displacements.begin(), 0);
  return displacements;
}
#endif

}  // namespace

Ranks::Ranks() : Ranks(Join()) {}

const Ranks& Ranks::Alone() {
  static const Ranks alone{nullptr};
  return alone;
}

std::vector<int> Ranks::Bounds(int count) const {
  std::vector<int> bounds;
  for (int r = 0; r <= size_; ++r) bounds.push_back(ShareBegin(count, r, size_));
  return bounds;
}

std::vector<std::byte> Ranks::Concatenate(std::span<const std::byte> mine) const {
  const std::vector<int64_t> sizes = Collect(static_cast<int64_t>(mine.size()));
  std::vector<int64_t> ends(sizes.size());
  std::partial_sum(sizes.begin(), sizes.end(), ends.begin());
  if (ends.back() > INT_MAX)
    throw std::length_error("ranks: more than 2 GiB to be gathered at once");
  std::vector<int> bounds{0};
  for (const int64_t end : ends) bounds.push_back(static_cast<int>(end));
  std::vector<std::byte> all(static_cast<size_t>(ends.back()));
  std::copy(mine.begin(), mine.end(), all.begin() + bounds[static_cast<size_t>(rank_)]);
  AllGather(all.data(), 1, bounds);
  return all;
}

void Ranks::TreeSum(int terms, std::span<const PartialSum> mine, std::span<float> sum) const {
  const auto all = static_cast<size_t>(size_), self = static_cast<size_t>(rank_);
  if (all == 1) {
    const PartialSum whole = AddUp(mine, 0, sum.size());
    std::copy_n(whole.values, sum.size(), sum.begin());
    return;
  }
  const std::vector<int> slices = Bounds(static_cast<int>(sum.size())), parts = Bounds(terms);
  const int slice = slices[self + 1] - slices[self];

  std::vector<float> send;  // to each rank, its slice of all that is mine
  std::vector<int> send_counts, receive_counts;
  std::vector<PartialSum> branches;  // everybody's
  for (size_t r = 0; r < all; ++r) {
    for (const PartialSum& part : mine)
      send.insert(send.end(), part.values + slices[r], part.values + slices[r + 1]);
    send_counts.push_back(static_cast<int>(mine.size()) * (slices[r + 1] - slices[r]));
    const size_t before = branches.size();
    for (const auto& [begin, end] : Branches(terms, parts[r], parts[r + 1]))
      branches.push_back({begin, end, nullptr});
    receive_counts.push_back(static_cast<int>(branches.size() - before) * slice);
  }
  std::vector<float> received(branches.size() * static_cast<size_t>(slice));
  Exchange(send.data(), send_counts, received.data(), receive_counts);
  for (size_t i = 0; i < branches.size(); ++i)
    branches[i].values = received.data() + i * static_cast<size_t>(slice);
  const PartialSum whole = AddUp(branches, 0, static_cast<size_t>(slice));
  std::copy_n(whole.values, slice, sum.begin() + slices[self]);
  AllGather(sum.data(), sizeof(float), slices);
}

#ifdef PLUMB_MPI

struct Ranks::Communicator {
  MPI_Comm group = MPI_COMM_WORLD;
};

std::unique_ptr<Ranks::Communicator> Ranks::Join() {
  if (!StartedByMpirun()) return nullptr;  // MPI_Init alone takes a second
  int threads;
  MPI_Init_thread(nullptr, nullptr, MPI_THREAD_FUNNELED, &threads);
  return std::make_unique<Communicator>();
}

Ranks::Ranks(std::unique_ptr<Communicator> communicator) : communicator_(std::move(communicator)) {
  if (!communicator_) return;
  MPI_Comm_rank(communicator_->group, &rank_);
  MPI_Comm_size(communicator_->group, &size_);
}

Ranks::~Ranks() {
  if (!communicator_ || std::uncaught_exceptions() > 0) return;
  if (communicator_->group == MPI_COMM_WORLD) {
    MPI_Finalize();
  } else {
    MPI_Comm_free(&communicator_->group);
  }
}

Ranks Ranks::OnThisMachine() const {
  if (!communicator_) return Ranks(nullptr);
  auto neighbours = std::make_unique<Communicator>();
  MPI_Comm_split_type(communicator_->group, MPI_COMM_TYPE_SHARED, 0, MPI_INFO_NULL,
                      &neighbours->group);
  return Ranks(std::move(neighbours));
}

void Ranks::Broadcast(std::span<std::byte> bytes) const {
  if (size_ == 1) return;
  constexpr size_t kMax = 1 << 30;  // MPI counts in int
  for (size_t first = 0; first < bytes.size(); first += kMax) {
    const size_t count = std::min(kMax, bytes.size() - first);
    MPI_Bcast(bytes.data() + first, static_cast<int>(count), MPI_BYTE, 0, communicator_->group);
  }
}

void Ranks::AllGather(void* items, size_t item_size, std::span<const int> bounds) const {
  if (size_ == 1) return;
  std::vector<int> counts(static_cast<size_t>(size_));
  for (size_t r = 0; r < counts.size(); ++r) counts[r] = bounds[r + 1] - bounds[r];
  MPI_Datatype item;  // counts are then items: an int does for them
  MPI_Type_contiguous(static_cast<int>(item_size), MPI_BYTE, &item);
  MPI_Type_commit(&item);
  MPI_Allgatherv(MPI_IN_PLACE, 0, MPI_DATATYPE_NULL, items, counts.data(), bounds.data(), item,
                 communicator_->group);
  MPI_Type_free(&item);
}

void Ranks::Exchange(const float* send, std::span<const int> send_counts, float* receive,
                     std::span<const int> receive_counts) const {
  MPI_Alltoallv(send, send_counts.data(), Displacements(send_counts).data(), MPI_FLOAT, receive,
                receive_counts.data(), Displacements(receive_counts).data(), MPI_FLOAT,
                communicator_->group);
}

#else

struct Ranks::Communicator {};

std::unique_ptr<Ranks::Communicator> Ranks::Join() {
  if (StartedByMpirun()) {
    throw std::runtime_error(
        "mpirun has started this, but it was built without OpenMPI: install libopenmpi-dev and "
        "build again");
  }
  return nullptr;
}

Ranks::Ranks(std::unique_ptr<Communicator>) {}
Ranks::~Ranks() = default;
Ranks Ranks::OnThisMachine() const { return Ranks(nullptr); }
void Ranks::Broadcast(std::span<std::byte>) const {}
void Ranks::AllGather(void*, size_t, std::span<const int>) const {}
void Ranks::Exchange(const float*, std::span<const int>, float*, std::span<const int>) const {}

#endif

}  // namespace plumb
