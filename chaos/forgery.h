#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "chaos/script.h"
#include "common/random.h"
#include "common/signature.h"
#include "plumb/lockstep_post_t.hpp"
#include "robot/description.h"

namespace plumb {

/// Makes what the monkey says itself, and what it makes others say. Not thread-safe.
class Forgery {
 public:
  /// @param key the run's. @param wrong_key another one.
  Forgery(const RobotDescription& robot, std::string bus, const SigningKey& key,
          const SigningKey& wrong_key);

  /// Something genuine has been said: it may be said again, or imitated.
  void Learn(const lockstep_post_t& post);
  /// What a prank (kReplay, kGarbage, kForge, kForgeFrame) says at once. @return nothing if the
  /// monkey has not heard yet what it would have to imitate.
  std::optional<lockstep_post_t> Make(const Prank& prank, Random& random) const;
  /// Puts mad numbers into a message, and seals it with the seal that it has, rightly signed.
  /// @return false if the message has no numbers that could be mad, and stays as it is.
  bool Madden(lockstep_post_t& post, Random& random) const;

 private:
  std::vector<uint8_t> Forged(const std::string& channel, Random& random) const;

  const std::vector<int> nodes_;  // of the drives
  const std::string robot_, bus_;
  const SigningKey key_, wrong_key_;
  std::map<std::string, std::vector<std::vector<uint8_t>>> heard_;  // by channel
};

}  // namespace plumb
