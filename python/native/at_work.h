#pragma once

#include <pybind11/pybind11.h>

#include <mutex>
#include <optional>
#include <stdexcept>
#include <string>

namespace plumb::python {

/// While it lives, other Python threads run, and none of them may use the same object: it would
/// write what this one reads.
class AtWork {
 public:
  /// @throws std::runtime_error if another thread is at work on it. With the GIL held.
  AtWork(std::mutex& mutex, const char* what) : lock_(mutex, std::try_to_lock) {
    if (!lock_) throw std::runtime_error(std::string(what) + ": another thread is at work on it");
    released_.emplace();
  }

 private:
  std::unique_lock<std::mutex> lock_;
  std::optional<pybind11::gil_scoped_release> released_;  // ends before the lock does
};

}  // namespace plumb::python
