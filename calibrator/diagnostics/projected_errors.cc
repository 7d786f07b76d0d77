#include "calibrator/diagnostics/projected_errors.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <stdexcept>
#include <utility>

#include "calibrator/inference/chi_squared.h"
#include "common/decompositions.h"
#include "common/median.h"
#include "sim/touch.h"

namespace plumb {
namespace {

// Fewer steps than these in contact or free: the two are not told apart.
constexpr int kFewest = 20;
constexpr double kMostOf =
    0.8;  // of the steps in contact are at the ground: then that is what contact is called

void RequireSizes(const FitResiduals& residuals, Eigen::Index n) {
  const auto rows = static_cast<Eigen::Index>(residuals.rows.size());
  if (residuals.errors.size() != rows || residuals.jacobian.rows() != rows ||
      residuals.noise_known.size() != static_cast<size_t>(2 * n) ||
      residuals.columns.cols() != static_cast<Eigen::Index>(residuals.candidates.size()) ||
      (residuals.columns.cols() > 0 && residuals.columns.rows() != rows)) {
    throw std::invalid_argument(
        "errors, their Jacobian and what they are about do not fit together");
  }
  for (const WindowErrors::Row& row : residuals.rows) {
    if (row.rollout < 0 || static_cast<size_t>(row.rollout) >= residuals.rollouts.size() ||
        row.transition < 0 ||
        static_cast<size_t>(row.transition) >=
            residuals.rollouts[static_cast<size_t>(row.rollout)].transitions.size() ||
        row.coordinate < 0 || row.coordinate >= 2 * n) {
      throw std::invalid_argument("an error is about no transition");
    }
  }
}

// Orthonormal, of the columns' range. A parameter without effect has no part in it.
Eigen::MatrixXd RangeBasis(const Eigen::MatrixXd& jacobian) {
  Eigen::MatrixXd scaled = jacobian;
  for (auto column : scaled.colwise()) {
    if (column.norm() > 0) column.normalize();
  }
  Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(scaled);
  qr.setThreshold(1e-7);
  return FirstColumns(qr.householderQ(), qr.rank());
}

// Steps that touch what.
struct Touching {
  int any = 0, ground = 0, stop = 0, links = 0;

  void Count(const Touch& touch) {
    any += touch.any();
    ground += touch.ground;
    stop += touch.stop;
    links += touch.links;
  }
  const char* InWords() const {
    if (ground >= kMostOf * any) return "at ground contact";
    if (stop >= kMostOf * any) return "at a stop";
    return links > 0 ? "in contact with the ground, a stop or another link"
                     : "in contact with the ground or a stop";
  }
};

bool SameReading(const Transition& a, const Transition& b) {
  return a.next_q.allFinite() && a.next_v.allFinite() && a.next_q == b.q && a.next_v == b.v;
}

bool Exact(const Transition& t) {
  return (t.q_sd.array() == 0).all() && (t.v_sd.array() == 0).all();
}

}  // namespace

ProjectedErrors::ProjectedErrors(const RobotDescription& robot, const FitResiduals& residuals)
    : n(robot.num_velocities()), noise_known_(residuals.noise_known) {
  RequireSizes(residuals, n);
  for (const JointDescription& joint : robot.joints) {
    joint_of.insert(joint_of.end(), static_cast<size_t>(joint.num_velocities()), joint.name);
  }
  std::map<std::pair<int, int>, int> index;
  for (const WindowErrors::Row& row : residuals.rows)
    index.emplace(std::pair(row.rollout, row.transition), 0);
  if (!residuals.where.empty() && residuals.where.size() != index.size())
    throw std::invalid_argument("it is not known of each transition where it was");
  TouchFinder finder(robot);
  Touching touching;
  for (auto& [key, number] : index) {
    number = static_cast<int>(steps.size());
    const auto& transitions = residuals.rollouts[static_cast<size_t>(key.first)].transitions;
    const Transition& transition = transitions[static_cast<size_t>(key.second)];
    Eigen::VectorXd q = transition.q, v = transition.v, next_q = transition.next_q;
    if (!residuals.where.empty()) {
      const Whereabouts& where = residuals.where[static_cast<size_t>(number)];
      q = where.q, v = where.v, next_q = where.next_q;
    }
    const Touch touch = finder.OfStep(q, next_q);
    touching.Count(touch);
    steps.push_back({&transition, std::move(q), std::move(v), touch.any(), -1, false,
                     std::vector<Eigen::Index>(static_cast<size_t>(2 * n), -1)});
    const auto before = index.find({key.first, key.second - 1});
    if (before == index.end()) continue;
    Step& last = steps[static_cast<size_t>(before->second)];
    if (last.transition->step + 1 != transition.step) continue;
    last.next = number;
    last.shares_state = !Exact(transition) && SameReading(*last.transition, transition);
  }
  contact_words = touching.InWords();
  conditions = touching.any >= kFewest && static_cast<int>(steps.size()) - touching.any >= kFewest;
  for (size_t i = 0; i < residuals.rows.size(); ++i) {
    const WindowErrors::Row& row = residuals.rows[i];
    step_of.push_back(index.at({row.rollout, row.transition}));
    coordinate.push_back(row.coordinate);
    steps[static_cast<size_t>(step_of.back())].rows[static_cast<size_t>(row.coordinate)] =
        static_cast<Eigen::Index>(i);
  }
  Weigh(residuals.errors);
  basis = RangeBasis(weight.asDiagonal() * residuals.jacobian);
  Take(weight.cwiseProduct(residuals.errors));
}

void ProjectedErrors::Explain(const Eigen::VectorXd& column) {
  basis.conservativeResize(Eigen::NoChange, basis.cols() + 1);
  basis.col(basis.cols() - 1) = column.normalized();
  Take(r);
}

void ProjectedErrors::Take(const Eigen::VectorXd& weighted) {
  r = Project(weighted);
  freedom = 1 - basis.rowwise().squaredNorm().array();
  Eigen::VectorXd squares = Eigen::VectorXd::Zero(2 * n), expected = squares;
  for (Eigen::Index i = 0; i < r.size(); ++i) {
    squares(coordinate[static_cast<size_t>(i)]) += r(i) * r(i);
    expected(coordinate[static_cast<size_t>(i)]) += freedom(i);
  }
  quiet.clear();
  for (Eigen::Index c = 0; c < 2 * n; ++c) {
    const double spread = std::sqrt(2 * std::max(0.0, expected(c)));
    quiet.push_back(noise_known_[static_cast<size_t>(c)] && squares(c) < expected(c) - 3 * spread);
  }
}

// Against the robust sd of the same coordinate in the same condition, but no less than the noise.
void ProjectedErrors::Weigh(const Eigen::VectorXd& errors) {
  std::map<std::pair<int, bool>, std::vector<double>> sizes;
  const auto group = [&](Eigen::Index row) {
    return std::pair(coordinate[static_cast<size_t>(row)], conditions && Contact(row));
  };
  for (Eigen::Index i = 0; i < errors.size(); ++i) sizes[group(i)].push_back(std::abs(errors(i)));
  std::map<std::pair<int, bool>, double> largest;
  for (const auto& [key, values] : sizes)
    largest[key] = kOutlier * std::max(1.0, kSdOverMedianDeviation * Median(values));
  weight.setOnes(errors.size());
  for (Eigen::Index i = 0; i < errors.size(); ++i) {
    const double ratio = largest[group(i)] / std::abs(errors(i));
    outlying.push_back(ratio < 1);
    if (ratio < 1) weight(i) = ratio;
  }
  FindRepeated();
  const auto outliers = std::ranges::count(outlying, true) - std::ranges::count(repeated, true);
  few_outliers =
      static_cast<double>(outliers) < kLeastOutliers * static_cast<double>(errors.size());
}

void ProjectedErrors::FindRepeated() {
  repeated.assign(outlying.size(), false);
  for (int joint = 0; joint < n; ++joint) {
    std::vector<bool> spoilt(steps.size(), false), again(steps.size(), false);
    const auto own = [&](size_t row) { return outlying[row] && coordinate[row] % n == joint; };
    for (size_t i = 0; i < outlying.size(); ++i) {
      if (own(i)) spoilt[static_cast<size_t>(step_of[i])] = true;
    }
    for (size_t i = 0; i < steps.size(); ++i) {
      if (!spoilt[i] || again[i] || !steps[i].shares_state) continue;
      const auto next = static_cast<size_t>(steps[i].next);
      again[next] = spoilt[next];
    }
    for (size_t i = 0; i < outlying.size(); ++i) {
      if (own(i)) repeated[i] = again[static_cast<size_t>(step_of[i])];
    }
  }
}

std::string ProjectedErrors::Place(const std::string& joint, const std::string& condition) const {
  const std::string where = condition == "contact" ? contact_words
                            : condition == "free"  ? "in free motion"
                                                   : "";
  const std::string who = joint.empty() ? "all joints" : joint;
  return where.empty() ? who : who + ", " + where;
}

Score FindScore(const ProjectedErrors& errors, const Eigen::VectorXd& column, double scale,
                double lower) {
  Score score;
  const double cc = column.squaredNorm();
  if (!(cc > 0) || !std::isfinite(cc)) return score;
  Eigen::VectorXd part = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(errors.steps.size()));
  for (Eigen::Index i = 0; i < column.size(); ++i)
    part(errors.step_of[static_cast<size_t>(i)]) += column(i) * errors.r(i);
  double neighbours = 0;
  for (size_t k = 0; k < errors.steps.size(); ++k) {
    const int next = errors.steps[k].next;
    if (next >= 0) neighbours += part(static_cast<Eigen::Index>(k)) * part(next);
  }
  const double sum = part.sum();
  const double variance = std::max(cc, part.squaredNorm() + 2 * std::max(0.0, neighbours));
  const double ridge = cc + 1 / (scale * scale);
  score.change = std::max(-sum / ridge, lower);
  score.gain = -2 * score.change * sum - score.change * score.change * cc;
  if (!(score.gain > 0)) return {};
  score.statistic = sum * sum / variance;
  score.p = ChiSquaredTail(1, score.statistic);
  return score;
}

}  // namespace plumb
