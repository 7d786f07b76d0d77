#pragma once

#include <cstdint>

namespace plumb {

/// How a shaft moves between two instants: the cubic with these positions and velocities at its
/// ends.
struct ShaftMotion {
  int64_t begin, end;                   ///< [us]
  double begin_position, end_position;  ///< [turns]
  double begin_velocity, end_velocity;  ///< [turns/s]

  double Position(int64_t time) const;
};

/// An incremental encoder as an ODrive reads it: the position is quantised to counts, the velocity
/// is that of a tracking loop of second order on the quantised position, run at the drive's 8 kHz:
///   p += dt v;  e = count - p;  p += dt kp e;  v += dt ki e;
///   kp = 2 b, ki = kp^2 / 4  (critically damped)
/// with bandwidth b = 1000 rad/s, ODrive's default (odriverobotics/ODrive,
/// Firmware/MotorControl/encoder.cpp). The velocity therefore lags by 2/b = 2 ms and carries
/// quantisation noise of some percent of a radian per second at 14 bit. Not thread-safe.
class Encoder {
 public:
  static constexpr double kBandwidth = 1000;  ///< [rad/s]
  static constexpr int64_t kPeriod = 125;     ///< [us]

  /// @param bits of one turn.
  explicit Encoder(int bits);

  /// The shaft has been put elsewhere: the loop starts anew, settled at this motion.
  void Reset(double position, double velocity);
  /// Follows the shaft: one turn of the loop at every multiple of kPeriod in (motion.begin,
  /// motion.end].
  void Track(const ShaftMotion& motion);

  /// The position that the encoder reads where the shaft is at `position` [turns]: the nearest
  /// count.
  double Quantise(double position) const;
  double velocity() const { return velocity_; }  ///< [turns/s]

 private:
  double counts_;
  double position_ = 0;
  double velocity_ = 0;
};

}  // namespace plumb
