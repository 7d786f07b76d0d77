#include "calibrator/results/identified_mjcf.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <stdexcept>
#include <string_view>

#include "robot/urdf/xml_edits.h"
#include "sim/mjcf.h"
#include "sim/model.h"

namespace plumb {
namespace {

constexpr std::array kElsewhere = {
    // kinds of parameters that MuJoCo's XML has no place for
    "delay/",           "sensor_delay/",     "sensor_bias/",    "no_load_speed/",
    "gear_efficiency/", "contact/stiffness", "contact/damping", "contact/slip_speed",
    "limit/stiffness",  "limit/damping",
};

bool InMjcf(std::string_view name) {
  return std::none_of(kElsewhere.begin(), kElsewhere.end(),
                      [&](std::string_view kind) { return name.starts_with(kind); });
}

std::string ModelComment(const RobotDescription& robot, const Eigen::VectorXd& mean,
                         const Eigen::VectorXd& sd, bool residual) {
  std::string here, elsewhere;
  for (size_t i = 0; i < robot.parameters.size(); ++i) {
    const ParameterDescription& p = robot.parameters[i];
    const auto at = static_cast<Eigen::Index>(i);
    const std::string unit = p.unit.empty() ? "" : " " + p.unit;
    (InMjcf(p.name) ? here : elsewhere) +=
        fmt::format("\n       {} = {:.6g}{}, sd {:.3g}{}", p.name, mean(at), unit, sd(at), unit);
  }
  std::string frozen;
  for (const FrozenParameter& f : robot.frozen) {
    if (!InMjcf(f.name)) frozen += fmt::format("\n       {} = {:.6g}, frozen", f.name, f.value);
  }
  std::string words = "The robot " + robot.name + " as Plumbline knows it, for MuJoCo.";
  if (!here.empty()) words += "\n     In this file:" + here;
  if (!elsewhere.empty() || !frozen.empty())
    words += "\n     MuJoCo's XML has no place for:" + elsewhere + frozen;
  for (const JointDescription& joint : robot.joints) {
    constexpr JointDynamics kDefault;
    for (const JointParameterKind& kind : kJointParameterKinds) {
      if (!InMjcf(fmt::format("{}/", kind.name)) &&
          joint.dynamics.*kind.member != kDefault.*kind.member)
        words += fmt::format("\n     nor for {} of joint {} in robot.toml.", kind.noun, joint.name);
    }
  }
  if (residual) {
    words +=
        "\n     The model does not explain the robot. What was learnt that it lacks, the residual "
        "in\n     posterior.json, is not in this file.";
  }
  return words + "\n    ";
}

}  // namespace

std::string IdentifiedMjcf(const RobotDescription& robot, const Eigen::VectorXd& mean,
                           const Eigen::VectorXd& sd, bool residual) {
  if (sd.size() != mean.size())
    throw std::invalid_argument("as many standard deviations as means are needed");
  RobotDescription identified = Model(robot).Describe(mean);
  identified.virtual_robot.ground = {};  // that of a virtual robot is hidden from who calibrates it
  XmlEdits file(Mjcf(identified));
  file.AddComment(ModelComment(robot, mean, sd, residual));
  return file.Print();
}

}  // namespace plumb
