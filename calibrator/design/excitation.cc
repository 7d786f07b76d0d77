#include "calibrator/design/excitation.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <stdexcept>
#include <tuple>
#include <utility>

#include "calibrator/fit/discrepancy.h"
#include "calibrator/fit/robot_draws.h"
#include "calibrator/motion/state_noise.h"
#include "common/decompositions.h"
#include "common/random.h"
#include "sim/simulator.h"
#include "sim/tasks/task.h"

namespace plumb {
namespace {

constexpr uint32_t kStartStream = 0x53544152, kDrawStream = 0x44524157;  // "STAR", "DRAW"
constexpr double kScales[] = {1, 0.5, 0.25};
constexpr double kHelps = 0.5, kHardlyHelps = 0.9;  // of the sd that was there before
constexpr double kDifference = 1e-4;                // of an sd of the belief

struct Motion {
  Rollout rollout;
  double margin;  // < 0: beyond a limit
  Eigen::MatrixXd q;
};

// The share of its limits that a state leaves unused, the least of all joints. Spherical joints
// have none.
double Margin(const RobotDescription& robot, const Eigen::VectorXd& q, const Eigen::VectorXd& v) {
  double margin = 1;
  Eigen::Index position = 0, velocity = 0;
  for (const JointDescription& joint : robot.joints) {
    if (std::isfinite(joint.velocity_limit))
      margin = std::min(margin, 1 - std::abs(v(velocity)) / joint.velocity_limit);
    if (!robot.simulation.stop && std::isfinite(joint.lower) && std::isfinite(joint.upper)) {
      const double range = joint.upper - joint.lower, at = q(position);
      margin = std::min({margin, (at - joint.lower) / range, (joint.upper - at) / range});
    }
    position += joint.num_positions(), velocity += joint.num_velocities();
  }
  return std::isfinite(margin) ? margin : -std::numeric_limits<double>::infinity();
}

/// Simulates excitations and weighs what they tell.
class Rater {
 public:
  Rater(const RobotDescription& robot, const Gaussian& belief, const ExcitationSettings& settings)
      : robot_(robot),
        belief_(belief),
        settings_(settings),
        task_(MakeTask(robot)),
        simulator_(robot),
        discrepancy_(robot),
        noise_(SmoothedNoise(robot)),
        root_(belief.covariance.llt().matrixL()) {
    std::tie(q_, v_) = ExcitationStart(robot, settings.seed);
    draws_.resize(belief.mean.size(), settings.draws + 1);
    draws_ << belief.mean, Draws();
  }

  std::optional<RatedExcitation> Rate(const Excitation& excitation) {
    for (const double scale : kScales) {
      Excitation scaled = excitation;
      scaled.action *= scale;
      if (scale < 1) scaled.name += fmt::format(", times {:g}", scale);
      std::vector<Motion> motions;
      while (static_cast<Eigen::Index>(motions.size()) < draws_.cols()) {
        motions.push_back(
            Move(scaled.action, draws_.col(static_cast<Eigen::Index>(motions.size()))));
        if (motions.back().margin < settings_.margin) break;
      }
      if (motions.back().margin >= settings_.margin) return Weigh(std::move(scaled), motions);
    }
    return std::nullopt;
  }

 private:
  Eigen::MatrixXd Draws() const {
    Random random(settings_.seed, {kDrawStream});
    const auto draw = [&](Eigen::Index count) {
      return Transform(belief_, StandardNormals(belief_.mean.size(), count, random));
    };
    const Eigen::MatrixXd first = draw(settings_.draws);
    Eigen::Index used = 0;
    return DrawRobots(Model(robot_), settings_.draws, [&]() -> Eigen::VectorXd {
      if (used < first.cols()) return first.col(used++);
      return draw(1);
    });
  }

  Motion Move(const Eigen::MatrixXd& action, const Eigen::VectorXd& coordinates) {
    const Eigen::Index n = robot_.num_velocities(), steps = action.rows();
    const double period = robot_.task.period,
                 latency = std::clamp(robot_.simulation.latency, 0.0, period);
    Motion motion{{}, Margin(robot_, q_, v_), Eigen::MatrixXd(robot_.num_positions(), steps + 1)};
    simulator_.SetParameters(robot_.ToPhysical(coordinates));
    simulator_.SetState(q_, v_);
    motion.q.col(0) = q_;
    Eigen::VectorXd effort = Eigen::VectorXd::Zero(n), last = effort;
    Eigen::Index done = 0;
    while (done < steps && motion.margin >= settings_.margin) {
      const Eigen::VectorXf units = action.row(done).transpose().cast<float>();
      task_->Effort(std::span(units.data(), static_cast<size_t>(units.size())), effort);
      Transition t;
      t.step = static_cast<int>(done);
      t.q = simulator_.q(), t.v = simulator_.v();
      if (latency > 0) t.efforts.push_back({latency, last});
      if (latency < period) t.efforts.push_back({period - latency, effort});
      last = effort;
      simulator_.Step(t.efforts);
      t.next_q = simulator_.q(), t.next_v = simulator_.v();
      t.q_sd = t.next_q_sd = noise_.head(n);
      t.v_sd = t.next_v_sd = noise_.tail(n);
      motion.margin = std::min(motion.margin, Margin(robot_, t.next_q, t.next_v));
      motion.q.col(++done) = t.next_q;
      motion.rollout.transitions.push_back(std::move(t));
      if (task_->Terminated(simulator_.q(), simulator_.v())) break;
    }
    motion.q.conservativeResize(Eigen::NoChange, done + 1);
    return motion;
  }

  Eigen::MatrixXd Information(const Rollout& rollout, const Eigen::VectorXd& coordinates) {
    Eigen::MatrixXd information =
        StepInformation(robot_, discrepancy_, std::span(&rollout, 1), coordinates,
                        kDifference * belief_.covariance.diagonal().cwiseSqrt());
    if (!information.allFinite())
      information.setZero();  // of a failing simulation nothing is learnt
    return information;
  }

  RatedExcitation Weigh(Excitation excitation, const std::vector<Motion>& motions) {
    const Eigen::Index d = belief_.mean.size();
    RatedExcitation rated{std::move(excitation),
                          std::numeric_limits<double>::infinity(),
                          {},
                          {},
                          1,
                          std::numeric_limits<int>::max(),
                          motions[0].q};
    for (size_t i = 0; i < motions.size(); ++i) {
      const Eigen::MatrixXd information =
          Information(motions[i].rollout, draws_.col(static_cast<Eigen::Index>(i)));
      const Eigen::MatrixXd scaled =
          Eigen::MatrixXd::Identity(d, d) + root_.transpose() * information * root_;
      const double gain = scaled.llt().matrixL().toDenseMatrix().diagonal().array().log().sum();
      rated.margin = std::min(rated.margin, motions[i].margin);
      rated.steps = std::min(rated.steps, static_cast<int>(motions[i].rollout.transitions.size()));
      if (gain >= rated.gain) continue;
      rated.gain = gain;
      rated.information = information;
      rated.sd = (root_ * Inverse(scaled) * root_.transpose()).diagonal().cwiseSqrt();
    }
    return rated;
  }

  const RobotDescription& robot_;
  const Gaussian& belief_;
  const ExcitationSettings& settings_;
  std::unique_ptr<Task> task_;
  Simulator simulator_;
  Discrepancy discrepancy_;
  Eigen::VectorXd noise_;
  Eigen::MatrixXd root_;
  Eigen::VectorXd q_, v_;
  Eigen::MatrixXd draws_;
};

// The covectors that measure movement along the weak directions.
Eigen::MatrixXd Measures(const RobotDescription& robot, const std::vector<WeakDirection>& weak) {
  Eigen::MatrixXd measures(static_cast<Eigen::Index>(robot.parameters.size()),
                           static_cast<Eigen::Index>(weak.size()));
  for (Eigen::Index i = 0; i < measures.rows(); ++i) {
    for (Eigen::Index k = 0; k < measures.cols(); ++k) {
      measures(i, k) = weak[static_cast<size_t>(k)].direction(i) /
                       robot.parameters[static_cast<size_t>(i)].coordinate_variance();
    }
  }
  return measures;
}

}  // namespace

std::pair<Eigen::VectorXd, Eigen::VectorXd> ExcitationStart(const RobotDescription& robot,
                                                            uint64_t seed) {
  Eigen::VectorXd q(robot.num_positions()), v(robot.num_velocities());
  Random random(seed, {0, kStartStream});
  MakeTask(robot)->InitialState(random, q, v);
  return {q, v};
}

std::vector<RatedExcitation> RateExcitations(const RobotDescription& robot, const Gaussian& belief,
                                             const ExcitationSettings& settings) {
  if (robot.parameters.empty())
    throw std::invalid_argument(robot.name + " has no parameters to be learned");
  if (robot.driven().empty())
    throw std::invalid_argument(robot.name + " has no motor to excite it");
  Rater rater(robot, belief, settings);
  std::vector<RatedExcitation> rated;
  for (const Excitation& excitation : MakeExcitations(robot, settings)) {
    if (auto one = rater.Rate(excitation)) rated.push_back(*std::move(one));
  }
  std::stable_sort(
      rated.begin(), rated.end(),
      [](const RatedExcitation& a, const RatedExcitation& b) { return a.gain > b.gain; });
  return rated;
}

Eigen::VectorXd PhysicalSd(const RobotDescription& robot, const Eigen::VectorXd& mean,
                           const Eigen::VectorXd& sd) {
  Eigen::VectorXd physical(sd.size());
  for (Eigen::Index i = 0; i < sd.size(); ++i) {
    const ParameterDescription& parameter = robot.parameters[static_cast<size_t>(i)];
    const double h = 1e-4 * std::sqrt(parameter.coordinate_variance());
    physical(i) =
        sd(i) * (parameter.ToPhysical(mean(i) + h) - parameter.ToPhysical(mean(i) - h)) / (2 * h);
  }
  return physical;
}

std::string DescribeGain(const RobotDescription& robot, const Gaussian& belief,
                         const RatedExcitation& rated) {
  const Eigen::VectorXd before = belief.covariance.diagonal().cwiseSqrt();
  const Eigen::VectorXd before_physical = PhysicalSd(robot, belief.mean, before);
  const Eigen::VectorXd after_physical = PhysicalSd(robot, belief.mean, rated.sd);
  std::string helps, hardly;
  for (Eigen::Index i = 0; i < before.size(); ++i) {
    const ParameterDescription& parameter = robot.parameters[static_cast<size_t>(i)];
    const double ratio = rated.sd(i) / before(i);
    if (ratio <= kHelps) {
      helps += fmt::format("{}{} (sd {:.2g} -> {:.2g}{}{})", helps.empty() ? "" : ", ",
                           parameter.name, before_physical(i), after_physical(i),
                           parameter.unit.empty() ? "" : " ", parameter.unit);
    }
    if (ratio >= kHardlyHelps) hardly += (hardly.empty() ? "" : ", ") + parameter.name;
  }
  if (helps.empty()) helps = "no parameter on its own";
  return "helps with " + helps + (hardly.empty() ? "" : "; hardly with " + hardly);
}

MotionAdvice AdviseMotion(const RobotDescription& robot, const Gaussian& posterior,
                          const Identifiability& found, const ExcitationSettings& settings) {
  MotionAdvice advice{RateExcitations(robot, posterior, settings), ""};
  if (advice.rated.empty()) {
    advice.summary = "no excitation that was tried keeps within the robot's limits";
    return advice;
  }
  if (!found.weak.empty()) {
    const Eigen::MatrixXd measures = Measures(robot, found.weak), precision = Precision(posterior);
    const auto left_open = [&](const RatedExcitation& rated) {
      const Eigen::MatrixXd covariance = Inverse(precision + rated.information);
      return (measures.transpose() * covariance * measures).determinant();
    };
    std::stable_sort(advice.rated.begin(), advice.rated.end(),
                     [&](const RatedExcitation& a, const RatedExcitation& b) {
                       return left_open(a) < left_open(b);
                     });
  }
  advice.summary =
      fmt::format("{} for {:.3g} s would tell most{}: {}", advice.rated[0].excitation.name,
                  advice.rated[0].steps * robot.task.period,
                  found.weak.empty() ? "" : " of what is hardly determined",
                  DescribeGain(robot, posterior, advice.rated[0]));
  return advice;
}

}  // namespace plumb
