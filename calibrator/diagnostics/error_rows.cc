#include "calibrator/diagnostics/error_rows.h"

namespace plumb {

std::vector<std::string> Conditions(const ProjectedErrors& errors) {
  return errors.conditions ? std::vector<std::string>{"contact", "free"}
                           : std::vector<std::string>{""};
}

ErrorRows RowsWhere(const ProjectedErrors& errors, const std::function<bool(int coordinate)>& which,
                    const std::string& condition, bool outliers) {
  ErrorRows rows;
  for (Eigen::Index i = 0; i < errors.r.size(); ++i) {
    const bool here = condition.empty() || errors.Contact(i) == (condition == "contact");
    if (here && which(errors.coordinate[static_cast<size_t>(i)]) && (outliers || !errors.Out(i)))
      rows.push_back(i);
  }
  return rows;
}

double SumOfSquares(const ProjectedErrors& errors, const ErrorRows& rows) {
  double sum = 0;
  for (const Eigen::Index i : rows) sum += errors.r(i) * errors.r(i);
  return sum;
}

std::string CoordinateName(const ProjectedErrors& errors, int coordinate) {
  const bool speed = coordinate >= errors.n;
  return (speed ? "speed of " : "position of ") +
         errors.joint_of[static_cast<size_t>(speed ? coordinate - errors.n : coordinate)];
}

const std::string& JointOf(const ProjectedErrors& errors, int coordinate) {
  return errors.joint_of[static_cast<size_t>(coordinate % errors.n)];
}

}  // namespace plumb
