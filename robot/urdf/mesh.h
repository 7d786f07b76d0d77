#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

namespace plumb {

/// Whether a file's name ends as those of STL and OBJ do. Thread-safe.
bool IsMeshFormat(const std::string& file);

/// Points that a mesh's faces have for corners, each once.
/// @param text an STL file, binary or of text, or a Wavefront OBJ file.
/// @throws std::runtime_error saying what is wrong, if it is neither, is an STL cut short, has no
/// face, a face with an unknown vertex, or a coordinate that is beyond 1e6 or not a number.
/// Thread-safe.
std::vector<Eigen::Vector3d> MeshPoints(const std::string& text);

/// Where a body can touch a plane: the corners of its convex hull.
struct HullCorners {
  std::vector<Eigen::Vector3d> corners;
  double lost = 0;  ///< [m] as much farther the body reaches at most, in any direction tried
};

/// As few of the points as reach as far as all of them, to half a millimetre in 512 directions
/// spread evenly (Fibonacci's lattice), at most 32: each is next the one that reaches farther than
/// those before it by the most. @param scale of the points' coordinates, to metres. Thread-safe.
HullCorners FindHullCorners(const std::vector<Eigen::Vector3d>& points,
                            const Eigen::Vector3d& scale = Eigen::Vector3d::Ones());

/// The file that a URDF names: package://name/rest is name/rest in one of the folders above the
/// URDF's, rest itself if one of these is called name, or in those that ROS_PACKAGE_PATH lists;
/// file://path is path; what is relative is so to the URDF's folder. Empty if there is none.
/// Thread-safe while nobody changes the environment.
std::string FindMesh(const std::string& named, const std::string& urdf_file);

}  // namespace plumb
