#include "calibrator/motion/differences.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>

#include "common/special_numbers.h"
#include "robot/physical.h"

namespace plumb {
namespace {

constexpr double kFewest = 20;  // places where all kinds of differences can be taken
// of the speeds: second differences below are rounding's, as in steady acceleration
constexpr double kRounding = 1e-6;

// Sums of squares over the places: of the difference from each kind, and of second differences.
struct Squares {
  std::array<double, 3> beside{};  // backward, forward, central
  double bent = 0, speeds = 0;
  double places = 0;
};

bool Follows(const Transition& before, const Transition& after) {
  return after.step == before.step + 1 && after.q == before.next_q;
}

void Add(const Transition& before, const Transition& at, const Transition& after,
         std::vector<Squares>* squares) {
  const double last = before.duration(), next = at.duration();
  for (size_t i = 0; i < squares->size(); ++i) {
    const auto c = static_cast<Eigen::Index>(i);
    const double v = at.v(c), back = at.q(c) - before.q(c), ahead = after.q(c) - at.q(c);
    Squares& sum = (*squares)[i];
    sum.beside[0] += std::pow(v - back / last, 2);
    sum.beside[1] += std::pow(v - ahead / next, 2);
    sum.beside[2] += std::pow(v - (back + ahead) / (last + next), 2);
    sum.bent += std::pow(after.v(c) - 2 * v + before.v(c), 2);
    sum.speeds += v * v;
    ++sum.places;
  }
}

}  // namespace

std::vector<std::string> DifferencedJoints(const RobotDescription& robot,
                                           std::span<const Rollout> rollouts) {
  const bool euler = robot.simulation.integrator == SimulationSettings::Integrator::kSemiImplicit;
  if (robot.num_positions() != robot.num_velocities() ||
      (euler && robot.simulation.substep >= robot.task.period)) {
    return {};
  }
  std::vector<Squares> squares(static_cast<size_t>(robot.num_velocities()));
  for (const Rollout& rollout : rollouts) {
    const auto& t = rollout.transitions;
    for (size_t k = 1; k + 1 < t.size(); ++k) {
      if (Follows(t[k - 1], t[k]) && Follows(t[k], t[k + 1]))
        Add(t[k - 1], t[k], t[k + 1], &squares);
    }
  }
  std::vector<std::string> joints;
  size_t velocity = 0;
  for (const JointDescription& joint : robot.joints) {
    const Squares& sum = squares[velocity++];
    const double least = *std::min_element(sum.beside.begin(), sum.beside.end());
    if (sum.places >= kFewest && sum.bent > kRounding * kRounding * sum.speeds &&
        least < kSameDifference * kSameDifference * sum.bent) {
      joints.push_back(joint.name);
    }
  }
  return joints;
}

std::string DifferencesWarning(std::span<const std::string> joints) {
  std::string names;
  for (const std::string& joint : joints) names += (names.empty() ? "v/" : ", v/") + joint;
  const bool one = joints.size() == 1;
  return names + (one ? " is" : " are") + " made of differences of the positions, and " +
         (one ? "tells" : "tell") +
         " nothing that these do not: auto, laplace and mixture do without; intervals of other "
         "methods will be too narrow";
}

std::vector<std::string> UnreadJoints(const RobotDescription& robot,
                                      std::span<const std::string> differenced) {
  if (robot.calibration.velocities) return {differenced.begin(), differenced.end()};
  std::vector<std::string> joints;
  for (const JointDescription& joint : robot.joints) joints.push_back(joint.name);
  return joints;
}

void RequireVelocities(const RobotDescription& robot, std::span<const Log> logs,
                       const std::string& who) {
  for (const Log& log : logs) {
    const std::vector<std::string> unread = UnreadJoints(robot, log.differenced);
    if (!unread.empty())
      throw std::invalid_argument(fmt::format(
          "{}: nobody has read the velocities of {}, and {} is compared with single control steps, "
          "which need them; record velocities, or use auto, laplace or mixture, which do without",
          log.name, fmt::join(unread, ", "), who));
  }
}

void ForgetVelocities(const RobotDescription& robot, std::span<const std::string> joints,
                      std::vector<Rollout>* rollouts) {
  if (joints.empty()) return;
  const ConfigurationSpace space(robot);
  std::vector<Eigen::Index> coordinates;
  Eigen::Index velocity = 0;
  for (const JointDescription& joint : robot.joints) {
    const bool named = std::ranges::find(joints, joint.name) != joints.end();
    for (int i = 0; i < joint.num_velocities(); ++i, ++velocity)
      if (named) coordinates.push_back(velocity);
  }
  Eigen::VectorXd squares = Eigen::VectorXd::Zero(velocity), count = squares;
  for (Rollout& rollout : *rollouts) {
    auto& t = rollout.transitions;
    for (size_t k = 0; k < t.size(); ++k) {
      const bool before = k > 0 && Follows(t[k - 1], t[k]);
      const double since = before ? t[k - 1].duration() : 0;
      const Eigen::VectorXd mean =
          space.Difference(t[k].next_q, before ? t[k - 1].q : t[k].q) / (since + t[k].duration());
      for (const Eigen::Index c : coordinates) {
        if (std::isfinite(mean(c))) t[k].v(c) = mean(c);
        const double change = before ? t[k].v(c) - t[k - 1].v(c) : kNaN;
        if (std::isfinite(change)) squares(c) += change * change, ++count(c);
        t[k].next_v(c) = kNaN;
      }
    }
  }
  for (Rollout& rollout : *rollouts) {
    for (Transition& t : rollout.transitions) {
      for (const Eigen::Index c : coordinates)
        t.v_sd(c) = std::max(kGuessSd * std::sqrt(squares(c) / std::max(1.0, count(c))), kLeastSd);
    }
  }
}

void DifferencePositions(const ConfigurationSpace& space, double period,
                         std::vector<MotionRow>* rows) {
  const auto follows = [&](size_t k) {  // row k + 1 row k
    const double interval = (*rows)[k + 1].t - (*rows)[k].t;
    return !(*rows)[k].ends && std::abs(interval - period) <= kPeriodTolerance * period;
  };
  for (size_t k = 1; k + 1 < rows->size(); ++k) {
    if (!follows(k - 1) || !follows(k)) continue;
    const MotionRow &before = (*rows)[k - 1], &after = (*rows)[k + 1];
    (*rows)[k].transition.v =
        space.Difference(after.transition.q, before.transition.q) / (after.t - before.t);
  }
}

}  // namespace plumb
