#pragma once

#include <algorithm>

#include "trainer/workers.h"

namespace plumb::python {

/// How a batch is shared out among threads: in groups that fill the lanes of an engine.
class Groups {
 public:
  /// @param workers must outlive it.
  Groups(int count, int lanes, Workers& workers) : count_(count), workers_(&workers) {
    const int share = count / (kGroupsPerThread * workers.size()) / lanes * lanes;
    together_ = std::clamp(share, kLeastTogether, kMostTogether);
  }

  /// work(first, last, worker) for all of the batch.
  template <class Work>
  void Run(const Work& work) {
    workers_->Run((count_ + together_ - 1) / together_, [&](int group, int worker) {
      work(group * together_, std::min(count_, (group + 1) * together_), worker);
    });
  }

 private:
  // So many even out what one of the threads loses to others on the machine.
  static constexpr int kGroupsPerThread = 4;
  static constexpr int kLeastTogether = 32;  // fewer are done before another thread has woken up
  static constexpr int kMostTogether = 64;   // what a group needs stays in the nearest cache

  int count_, together_;
  Workers* workers_;
};

}  // namespace plumb::python
