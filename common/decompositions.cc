#include "common/decompositions.h"

#include <Eigen/LU>

namespace Eigen {

template LLT<MatrixXd>& LLT<MatrixXd>::compute(const EigenBase<MatrixXd>&);
template LDLT<MatrixXd>& LDLT<MatrixXd>::compute(const EigenBase<MatrixXd>&);
template void HouseholderQR<MatrixXd>::computeInPlace();
template void ColPivHouseholderQR<MatrixXd>::computeInPlace();
template void FullPivHouseholderQR<MatrixXd>::computeInPlace();
template JacobiSVD<MatrixXd>& JacobiSVD<MatrixXd>::compute(const MatrixXd&, unsigned int);
template SelfAdjointEigenSolver<MatrixXd>& SelfAdjointEigenSolver<MatrixXd>::compute(
    const EigenBase<MatrixXd>&, int);

}  // namespace Eigen

namespace plumb {

Eigen::MatrixXd Inverse(const Eigen::MatrixXd& m) { return m.inverse(); }

Eigen::MatrixXd FirstColumns(
    const Eigen::HouseholderQR<Eigen::MatrixXd>::HouseholderSequenceType& q, Eigen::Index columns) {
  return q * Eigen::MatrixXd::Identity(q.rows(), columns);
}

}  // namespace plumb
