#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <vector>

#include "common/tree_sum.h"

namespace plumb {

/// Several copies of a program, on one machine or many, that share the work: started with `mpirun
/// -n 4 plumb ...`. All of them run the same computation on the same data, each does part of the
/// parts that take long, and all get all of the results; rank 0 alone speaks and writes. Without
/// mpirun, or in a build without OpenMPI, there is one rank.
///
/// The methods that exchange data are called by all ranks, in the same order; with one rank they
/// cost nothing. To be used by one thread, and made once at most.
class Ranks {
 public:
  /// Joins the others if mpirun has started this program. @throws std::runtime_error if it has and
  /// this build has no MPI.
  Ranks();
  /// A rank that an exception takes out says no farewell: mpirun then ends the others, which would
  /// wait for it.
  ~Ranks();
  Ranks(const Ranks&) = delete;
  Ranks& operator=(const Ranks&) = delete;

  /// The only rank, whatever has started the program.
  static const Ranks& Alone();

  int rank() const { return rank_; }
  int size() const { return size_; }

  /// Those that run on the same machine as this one, as ranks of their own: what they exchange
  /// takes microseconds. Called by all ranks. Must not outlive this.
  Ranks OnThisMachine() const;

  /// Shares `count` things out, evenly but for one: rank r has [Bounds[r], Bounds[r + 1]).
  std::vector<int> Bounds(int count) const;

  /// All get what rank 0 has.
  void Broadcast(std::span<std::byte> bytes) const;

  /// Each rank has filled in its part of the items, those that `bounds` gives it, and gets the
  /// others'.
  /// @param items bounds.back() of them, of item_size bytes each. @param bounds as from Bounds, or
  /// other ones.
  void AllGather(void* items, size_t item_size, std::span<const int> bounds) const;

  /// A value of each rank, in their order. T is trivially copyable.
  template <class T>
  std::vector<T> Collect(const T& mine) const {
    std::vector<T> all(static_cast<size_t>(size_), mine);
    AllGather(all.data(), sizeof(T), Bounds(size_));
    return all;
  }

  /// The bytes of all ranks, in their order. Each may have another number of them.
  /// @throws std::length_error if it is more than 2 GiB.
  std::vector<std::byte> Concatenate(std::span<const std::byte> mine) const;

  /// The sum of many vectors in the order of tree_sum.h, and so of the same bits for any number of
  /// ranks. Each rank sums one slice of the vectors, of all ranks' branches: two messages between
  /// any two ranks, together as long as those of any all-reduce.
  /// @param terms of the sum; the ranks have them as Bounds(terms) says. @param mine
  /// Branches(terms, ...) of this rank's terms; the values may be overwritten. @param sum written.
  void TreeSum(int terms, std::span<const PartialSum> mine, std::span<float> sum) const;

 private:
  struct Communicator;  // MPI's name of the group
  explicit Ranks(std::unique_ptr<Communicator> communicator);
  static std::unique_ptr<Communicator> Join();
  void Exchange(const float* send, std::span<const int> send_counts, float* receive,
                std::span<const int> receive_counts) const;

  std::unique_ptr<Communicator> communicator_;  // null: the only rank
  int rank_ = 0, size_ = 1;
};

}  // namespace plumb
