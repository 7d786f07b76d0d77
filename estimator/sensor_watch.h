#pragma once

#include <cmath>

#include "common/special_numbers.h"

namespace plumb {

/// Exponential average of a reading's normalised innovation squared, over about half a second. NaN
/// before the first.
class NisAverage {
 public:
  static constexpr double kTime = 0.5;  ///< [s]

  /// @param elapsed [s] since the last reading.
  void Add(double nis, double elapsed) {
    if (!std::isfinite(nis)) return;  // of a filter that is about to restart
    const double weight = std::isnan(value_) ? 1 : -std::expm1(-elapsed / kTime);
    value_ = std::isnan(value_) ? nis : value_ + weight * (nis - value_);
  }
  double value() const { return value_; }

 private:
  double value_ = kNaN;
};

/// Two sensors of one motion, of a level and of its rate (position and velocity, velocity and
/// acceleration): the change of the level in a quarter of a second must be the integral of the
/// rate. No model of the motion is needed for that, so an impact raises no alarm, and a fault shows
/// that neither sensor's readings alone would reveal. Does not allocate. Not thread-safe.
class AgreementWatch {
 public:
  enum class Finding {
    kNone,
    kLevelStuck,  ///< the level always reads the same, but the rate says it moves
    kRateStuck,
    kLevelJumped,  ///< at one reading
    kDisagree,     ///< all along: drift, a wrong scale, a bias
  };
  struct Settings {
    double level_sd, rate_sd;  ///< white noise of each reading
    double rate_bias = 0;      ///< that would be in order
    double rate_lag = 0;       ///< [s] by which the rate may be late
  };
  static constexpr double kWindow = 0.25;  ///< [s]
  /// [s] between readings; after it a window begins anew
  static constexpr double kLongestGap = 0.1;
  static constexpr double kSigmas = 6;  ///< beyond which there is no doubt

  explicit AgreementWatch(const Settings& settings) : s_(settings) {}

  /// A reading of both. @param elapsed [s] since the last one, > 0.
  void Add(double level, double rate, double elapsed);
  /// The window begins anew: the motion was interrupted. Earlier findings remain.
  void Restart() { readings_ = 0; }

  /// Of the last complete window.
  Finding finding() const { return finding_; }
  /// change of the level less the rate's integral, and the largest part of it at one reading
  double excess() const { return excess_; }
  double jump() const { return jump_; }
  double duration() const { return duration_; }  ///< [s]
  double level() const { return level_; }        ///< the newest

 private:
  void Judge();

  Settings s_;
  int readings_ = 0;  // in the window
  double level_ = 0, rate_ = 0, first_level_ = 0, first_rate_ = 0;
  double time_ = 0, integral_ = 0, variance_ = 0, largest_step_ = 0;
  bool level_moved_ = false, rate_moved_ = false;
  Finding finding_ = Finding::kNone;
  double excess_ = 0, jump_ = 0, duration_ = 0;
};

}  // namespace plumb
