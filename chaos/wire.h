#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "chaos/script.h"
#include "common/random.h"
#include "plumb/lockstep_post_t.hpp"

namespace plumb {

/// What is on its way to somebody, and what becomes of it under the pranks that last. Not
/// thread-safe.
class Wire {
 public:
  /// Makes a message mad and seals it anew. @return false if there is nothing in it that could be.
  using Madness = std::function<bool(lockstep_post_t&, Random&)>;

  Wire(uint64_t seed, Madness madness) : seed_(seed), madness_(std::move(madness)) {}

  /// From now on, for its duration. @param now [us]
  void Begin(const Prank& prank, int64_t now);
  /// @param now [us] @return what the listener hears of it.
  std::vector<lockstep_post_t> Carry(const lockstep_post_t& post, const std::string& listener,
                                     int64_t now);

 private:
  struct Window {
    Prank prank;
    int64_t end;
    Random random;
  };
  void Befall(Window& window, std::vector<lockstep_post_t>& arrivals) const;

  const uint64_t seed_;
  const Madness madness_;
  std::vector<Window> windows_;
};

}  // namespace plumb
