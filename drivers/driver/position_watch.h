#pragma once

#include "common/special_numbers.h"
#include "drivers/protocols/reason.h"
#include "robot/description.h"

namespace plumb {

/// Whether a joint is measured where its position limits do not let it be: a zero, a sign or a gear
/// ratio that is wrong shows first like that. This is a warning and no fault, for a joint that
/// somebody has put there must be able to move back.
///
/// It begins when the joint is beyond a limit by kMargin of its range, and ends within the limits,
/// so that a joint that trembles there is not warned of again and again. No method throws or
/// allocates. Not thread-safe.
class PositionWatch {
 public:
  /// A joint that is pressed against its stop is beyond its limit by milliradians, one that hits it
  /// hard by some hundredths of its range. A sign or a gear ratio that is wrong leads farther.
  static constexpr double kMargin = 0.05;

  explicit PositionWatch(const JointDescription& joint);

  /// @param position [rad] or [m] measured; NaN = it has not been.
  void Look(double position) noexcept;
  bool beyond() const noexcept { return beyond_; }
  /// Where it is, the limit, and what may be wrong; empty if it is not beyond.
  Reason Warning() const noexcept;

 private:
  double lower_, upper_;  // infinite: none
  const char* unit_;
  double position_ = kNaN;
  bool beyond_ = false;
};

}  // namespace plumb
