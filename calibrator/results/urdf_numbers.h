#pragma once

#include <Eigen/Core>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "robot/description.h"
#include "robot/urdf/urdf.h"
#include "robot/urdf/xml_edits.h"

namespace plumb {

/// A URDF's text in which links and joints get other numbers. Those that differ by rounding only
/// stay as they are written.
/// Not thread-safe.
class UrdfNumbers {
 public:
  /// @param file what LoadUrdf makes of the text. @param now what it shall make of the result. Both
  /// must outlive this.
  UrdfNumbers(const std::string& text, const UrdfModel& file, const RobotDescription& now);

  /// Writes mass, centre of mass and inertia of links[index], and what its being `stretch` times as
  /// long moves: all that is fixed to it, the origins of the joints that it carries, and the sizes
  /// of its solids. Nothing for the links without mass of a planar or floating joint.
  void WriteLink(size_t index, double stretch);
  /// @param attribute of a joint's <dynamics>, which is added if there is none. Once for each.
  void WriteDynamics(const std::string& joint, const char* attribute, double value);
  void AddComment(const std::string& words) { edits_.AddComment(words); }

  std::string Print();

 private:
  /// A URDF link in the link of ours that it is welded to.
  struct Body {
    const TiXmlElement* link;
    Eigen::Vector3d at;    // of its frame, as the file has it
    Eigen::Matrix3d axes;  // of its frame
    double mass() const;
  };

  void Collect(const Body& body);
  void ForEachJoint(const TiXmlElement& parent,
                    const std::function<void(const TiXmlElement&)>& function) const;
  void Set(const TiXmlElement& element, const char* attribute, const std::vector<double>& values,
           double scale);
  void SetPosition(const TiXmlElement& parent, const Eigen::Vector3d& position);
  void Stretch(double factor);
  void StretchSolid(const TiXmlElement& solid, double factor);
  void WriteInertials(const LinkDescription& link, double stretch);
  void WriteInertia(const TiXmlElement& element, const Eigen::Matrix3d& inertia);

  XmlEdits edits_;
  const UrdfModel& file_;
  const RobotDescription& now_;
  std::vector<Body> bodies_;                           // of the link at hand
  std::map<std::string, std::string> added_dynamics_;  // attributes by joint
};

}  // namespace plumb
