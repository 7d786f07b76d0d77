#pragma once

#include <Eigen/Core>
#include <functional>
#include <vector>

namespace plumb {

/// A basis of a linear space in the plainest form: each vector with as few entries as can be found,
/// small integers where they do.
///
/// The sparsest basis of a space is NP-hard to find (Coleman, Pothen, SIAM J. Alg. Disc. Meth. 7,
/// 1986, section 2). It consists of elementary vectors, whose entries' places no other vector's are
/// a part of (Rockafellar, 1969), and a greedy choice from a set of them is the sparsest that the
/// set allows (they form a matroid). The set is that of many reduced echelon forms, whose columns
/// are elementary, with pivots in orders drawn from a fixed seed. Entries are integers in the end
/// if `belongs` agrees.
///
/// @param space n x k, its columns span the space.
/// @param unit n, > 0: what counts as a change of one of each coordinate, for telling entries from
/// zeros.
/// @param belongs whether a vector counts as one of the space: decides on roundings.
/// @return k independent vectors, those with the fewest entries first; the first entry of each that
/// is not zero is positive. Rounded ones have integer entries up to kLargestInteger, others 1 as
/// first one. Thread-safe.
std::vector<Eigen::VectorXd> SparseBasis(
    const Eigen::MatrixXd& space, const Eigen::VectorXd& unit,
    const std::function<bool(const Eigen::VectorXd&)>& belongs);

inline constexpr int kLargestInteger = 4;

}  // namespace plumb
