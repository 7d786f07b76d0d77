#include "calibrator/motion/table_units.h"

#include <fmt/format.h>

#include <cmath>
#include <utility>

#include "calibrator/motion/transitions.h"

namespace plumb {
namespace {

constexpr double kMost = 0.5, kSome = 0.01;  // of the rows
constexpr double kBeyondLimit = 1 + 1e-9;  // an effort so far beyond its limit is not just rounded
// A policy that explores with a Gaussian, and is clipped in less than most rows, asks for more than
// this in one of 1300.
constexpr double kManyTimes = 5;  // the effort limit
// of the range between a joint's limits: a stop gives way, and an encoder may have turned on
constexpr double kFar = 0.5;

bool Slides(const JointDescription& joint) {
  return joint.type == JointDescription::Type::kPrismatic;
}

// Of the rows where it is known.
template <class IsBeyond>
double Share(const std::vector<MotionRow>& rows, Eigen::VectorXd Transition::*state,
             Eigen::Index coordinate, const IsBeyond& is_beyond) {
  double known = 0, beyond = 0;
  for (const MotionRow& row : rows) {
    const double x = (row.transition.*state)(coordinate);
    known += !std::isnan(x);
    beyond += is_beyond(x);
  }
  return known > 0 ? beyond / known : 0;
}

// Columns with their shares of rows, and what to ask about them.
class Question {
 public:
  Question(std::string what, std::string unit) : what_(std::move(what)), unit_(std::move(unit)) {}

  void Add(const std::string& column, double share) {
    if (share <= kMost) return;
    columns_ += fmt::format("{}{} in {:.0f} %{}", columns_.empty() ? "" : ", ", column, 100 * share,
                            columns_.empty() ? " of the rows" : "");
  }
  void AppendTo(std::vector<std::string>* questions) const {
    if (!columns_.empty()) questions->push_back(what_ + ": " + columns_ + ": " + unit_ + "?");
  }

 private:
  std::string what_, unit_, columns_;
};

}  // namespace

std::vector<std::string> AskStateUnits(const std::vector<MotionRow>& rows, bool velocities,
                                       const RobotDescription& robot) {
  const std::string far = "far beyond the joint's limits", fast = "beyond the joint's speed limit";
  const std::string rate = velocities ? " per second" : "", column = velocities ? "v/" : "q/";
  Question angles(far, "degrees"), lengths(far, "millimetres"), rates(fast, "degrees" + rate),
      speeds(fast, "millimetres" + rate);
  for (int i = 0; i < robot.num_joints(); ++i) {
    const JointDescription& joint = robot.joints[static_cast<size_t>(i)];
    if (joint.num_positions() != 1) continue;
    const double range = joint.upper - joint.lower;  // infinite: nothing is beyond
    const double q = Share(rows, &Transition::q, robot.position_of(i), [&](double x) {
      return range > 0 && (x > joint.upper + kFar * range || x < joint.lower - kFar * range);
    });
    const double v = Share(rows, &Transition::v, robot.velocity_of(i), [&](double x) {
      return joint.velocity_limit > 0 && std::abs(x) > joint.velocity_limit;
    });
    (Slides(joint) ? lengths : angles).Add("q/" + joint.name, q);
    (Slides(joint) ? speeds : rates).Add(column + joint.name, v);
  }
  std::vector<std::string> questions;
  for (const Question* question : {&angles, &lengths, &rates, &speeds})
    question->AppendTo(&questions);
  return questions;
}

void ActionCounts::Add(double asked, double limit) {
  known += !std::isnan(asked);
  clipped += std::abs(asked) > kBeyondLimit * limit;
  far += std::abs(asked) > kManyTimes * limit;
}

std::string AskActionUnit(const std::string& column, const JointDescription& joint, double unit,
                          const ActionCounts& counts) {
  const auto known = static_cast<double>(counts.known);
  const bool most = static_cast<double>(counts.clipped) > kMost * known;
  if (!most && static_cast<double>(counts.far) <= kSome * known) return {};
  const char* const newtons = Slides(joint) ? "N" : "Nm";
  const std::string ask = unit == 1 ? fmt::format("m{}?", newtons)
                                    : fmt::format("{}? 1 is {:g} {}", newtons, unit, newtons);
  return most ? fmt::format("{}: {} of {} are beyond the effort limit: {}", column, counts.clipped,
                            counts.known, ask)
              : fmt::format("{}: {} of {} are beyond {:g} times the effort limit: {}", column,
                            counts.far, counts.known, kManyTimes, ask);
}

std::string AskTimeUnit(double interval, double period) {
  constexpr std::pair<double, const char*> kUnits[] = {
      {1e3, "milliseconds"}, {1e6, "microseconds"}, {1e9, "nanoseconds"}};
  for (const auto& [factor, unit] : kUnits) {
    if (std::abs(interval / period / factor - 1) <= kPeriodTolerance)
      return fmt::format("is t in {}?", unit);
  }
  return {};
}

}  // namespace plumb
