#pragma once

#include <Eigen/Core>

namespace plumb {

/// q, v or effort of a robot with one joint.
inline Eigen::VectorXd Scalar(double x) { return Eigen::VectorXd::Constant(1, x); }

}  // namespace plumb
