#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "robot/description.h"

namespace plumb {

// Functions here are pure: thread-safe.

/// A robot at a time.
struct Snapshot {
  double time;        ///< [s]
  Eigen::VectorXd q;  ///< [rad] or [m], as in RobotDescription
};

/// Side views of a robot: its visual shapes, or collision shapes where a link has none of these,
/// projected onto the vertical plane in which it moves most, x-z or y-z; the ground, z = 0 of the
/// base; and the time. The view moves along with a robot that walks away. A robot without any shape
/// is drawn as a stick figure.
/// @param panels how many snapshots at most, evenly from the first to the last, side by side.
/// @return a PNG file.
/// @throws std::invalid_argument if there is no snapshot.
std::string DrawStrip(const RobotDescription& robot, const std::vector<Snapshot>& film,
                      int panels = 8);

/// The same views as an endless film in real time, 25 pictures per second. @return a GIF file.
/// @throws std::invalid_argument if there is no snapshot.
std::string DrawFilm(const RobotDescription& robot, const std::vector<Snapshot>& film);

}  // namespace plumb
