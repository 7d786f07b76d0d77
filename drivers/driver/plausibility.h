#pragma once

#include <cstdint>

#include "drivers/protocols/reason.h"
#include "robot/description.h"

namespace plumb {

/// The bounds by which a joint's estimates are judged.
struct PlausibilitySettings {
  double velocity_limit;  ///< [rad/s] or [m/s] > 0; infinite: jumps are not looked for
  double effort_limit;    ///< [Nm] or [N] > 0
  double resolution;      ///< [rad] or [m] > 0 differences of positions that mean nothing
  int64_t period;         ///< [us] > 0 at which one device sends estimates
  /// [us] > 0 by which an estimate may be late; silence of more begins anew
  int64_t lateness;
  int64_t stuck_after;  ///< [us] as DriverSettings::stuck_after; 0 = not looked for
};

/// Of a joint with a motor. @throws std::invalid_argument for an unknown protocol.
PlausibilitySettings PlausibilityOf(const JointDescription& joint, const DriverSettings& settings);

/// Whether one joint's estimates can be true. Looked for, with T the period and L the lateness:
///
/// - a jump: the position changed by more than
///     velocity_limit (dt + T) + v L + resolution,
///   dt the time between the two arrivals, v the previous velocity in the jump's direction, 0 if it
///   has the other. L, for those before may have come late, so that more time has passed than dt;
///   T, for the joint may have become faster since;
/// - two sources that disagree: within a window of 100 estimates the position changed by D, the
///   integral of the velocity (trapezoids) is I, and
///     |D - I| > resolution + max(path of D, path of I) / 4
///               + L (|v first| + |v last| + sum |change of v|).
///   A lag of the velocity, or an error of the times of arrival, up to L is within the last term
///   (summation by parts);
/// - stuck: position and velocity are the same bit by bit for `stuck_after` while the effort sent
///   is a tenth of the limit or more;
/// - two devices with one id, or somebody who asks the one for more: more than 150 estimates within
///   100 T.
///
/// Losses, delays, bunches and doubles on the bus are no faults here. Pure logic; free of
/// exceptions and allocation. Not thread-safe.
class Plausibility {
 public:
  static constexpr int kWindow = 100;            ///< estimates, or periods
  static constexpr int kMaxInWindow = 150;       ///< estimates of one device within kWindow periods
  static constexpr double kDisagreement = 0.25;  ///< part of the path
  static constexpr double kEffort = 0.1;         ///< of the limit, under which a joint should move

  explicit Plausibility(const PlausibilitySettings& settings) : settings_(settings) {}

  /// Judges an estimate. A complaint stays until it is taken back.
  /// @param time [us] of its arrival by any one clock; if that is set back, judging begins anew.
  /// @param velocity NaN = the device has none: only jumps, stuck and two devices are looked for.
  /// @param effort [Nm] or [N] last sent.
  void Add(int64_t time, double position, double velocity, double effort) noexcept;

  /// The joint may have been put elsewhere at once: all but the number of devices is judged anew
  /// from the next estimate on.
  void Displaced() noexcept { seen_ = jumped_ = false; }

  /// The first thing that was implausible; empty if nothing was.
  std::string_view complaint() const noexcept { return complaint_.text(); }
  /// Takes the complaint back. What is wrong still will be found again.
  void ClearComplaint() noexcept { complaint_.Clear(); }
  /// Its position has jumped: what it counts from may be elsewhere by as much, until somebody has
  /// homed the joint.
  bool lost_place() const noexcept { return jumped_; }
  void Homed() noexcept { jumped_ = false; }
  /// Whether more than one device seems to send estimates; so until 100 T have gone by with no more
  /// than one would.
  bool crowded() const noexcept { return crowded_; }

 private:
  struct Estimate {
    int64_t time = 0;
    double position = 0, velocity = 0;
  };
  /// Since when, and over what, position and velocity are compared.
  struct Comparison {
    double first_velocity = 0;
    int estimates = 0;
    double moved = 0, said = 0;            ///< [rad] or [m] by position; by velocity
    double moved_path = 0, said_path = 0;  ///< the same without signs
    double swing = 0;                      ///< [rad/s] or [m/s] sum of the velocity's changes
    double seconds = 0;
  };

  template <class... Args>
  void Complain(fmt::format_string<Args...> format, Args&&... args) noexcept {
    if (complaint_.text().empty()) complaint_.Set(format, std::forward<Args>(args)...);
  }
  void CountDevices(int64_t time) noexcept;
  bool Jumped(const Estimate& next) noexcept;
  void LookForStuck(const Estimate& next, double effort) noexcept;
  void Compare(const Estimate& next) noexcept;
  double Slack(double position) const noexcept;
  void Begin(const Estimate& first) noexcept;

  PlausibilitySettings settings_;
  Reason complaint_;
  bool seen_ = false;
  bool jumped_ = false;
  Estimate last_;
  Comparison comparison_;
  int64_t unchanged_ = 0;  // [us] under an effort
  int64_t window_ = 0;     // begin of that in which estimates are counted
  int count_ = 0;
  bool crowded_ = false;
};

}  // namespace plumb
