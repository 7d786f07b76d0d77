#pragma once

#include <pybind11/pybind11.h>

#include <atomic>
#include <chrono>
#include <thread>

namespace plumb::python {

/// Whether Ctrl-C, or what else a signal's handler raises, is to end work that threads share. Made
/// by the thread that Python has called: it alone may see signals. It looks for them now and then
/// only, as it has to wait for the GIL.
class Interruption {
 public:
  /// Whether what has not begun is to be left undone. On any of these threads, without the GIL.
  bool came() {
    const auto now = std::chrono::steady_clock::now();
    if (std::this_thread::get_id() == caller_ && !came_ && now - looked_ > kBetweenLooks) {
      looked_ = now;
      const pybind11::gil_scoped_acquire acquired;
      came_ = PyErr_CheckSignals() != 0;
    }
    return came_;
  }

  /// Once the work is over, with the GIL. @throws pybind11::error_already_set what was raised.
  void Raise() const {
    if (came_) throw pybind11::error_already_set();
  }

 private:
  static constexpr std::chrono::milliseconds kBetweenLooks{100};

  const std::thread::id caller_ = std::this_thread::get_id();
  std::chrono::steady_clock::time_point looked_ = std::chrono::steady_clock::now();  // the caller's
  std::atomic<bool> came_ = false;
};

}  // namespace plumb::python
