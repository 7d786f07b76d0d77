#pragma once

#include <Eigen/Core>

namespace plumb::python {

/// In the order in which numpy has its arrays.
template <class T>
using Matrix = Eigen::Matrix<T, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

}  // namespace plumb::python
