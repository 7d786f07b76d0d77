#include "calibrator/fit/physical_columns.h"

namespace plumb {

Eigen::MatrixXd PhysicalColumns(const RobotDescription& robot, const Eigen::MatrixXd& coordinates) {
  Eigen::MatrixXd physical(coordinates.rows(), coordinates.cols());
  for (Eigen::Index i = 0; i < coordinates.cols(); ++i)
    physical.col(i) = robot.ToPhysical(coordinates.col(i));
  return physical;
}

}  // namespace plumb
