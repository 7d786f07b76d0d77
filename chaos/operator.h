#pragma once

#include <cstdint>
#include <string>

#include "common/messenger.h"
#include "plumb/controller_status_t.hpp"
#include "plumb/driver_request_t.hpp"
#include "plumb/driver_status_t.hpp"

namespace plumb {

/// The person at the run: sees what driver and controller say of themselves, and arms again
/// whenever the motors are off. Time is the run's [us]. Not thread-safe.
class Operator {
 public:
  /// @param messenger that has its identity already; must outlive this.
  explicit Operator(Messenger& messenger);

  /// To be called now and then: asks twice a second at most.
  void KeepArmed(int64_t now);
  /// @param what a constant of driver_request_t.
  void Request(int64_t now, int8_t what);

  /// Whether the policy of that iteration has been judged on the robot.
  bool Finished(int iteration) const;
  /// How driver and controller are, for people.
  std::string Situation() const;

 private:
  Publisher<driver_request_t> requests_;
  Subscriber<driver_status_t> drivers_;
  Subscriber<controller_status_t> controllers_;
  int64_t asked_ = 0;
};

}  // namespace plumb
