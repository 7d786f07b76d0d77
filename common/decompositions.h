#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <Eigen/SVD>

// Eigen's decompositions of matrices of any size, compiled in decompositions.cc alone: each costs
// the compiler seconds in every file that it compiles them for. What is decomposed must be a
// MatrixXd, as an expression is another type: LLT<MatrixXd>(MatrixXd(a + b)), not (a + b).llt().
namespace Eigen {

extern template LLT<MatrixXd>& LLT<MatrixXd>::compute(const EigenBase<MatrixXd>&);
extern template LDLT<MatrixXd>& LDLT<MatrixXd>::compute(const EigenBase<MatrixXd>&);
extern template void HouseholderQR<MatrixXd>::computeInPlace();
extern template void ColPivHouseholderQR<MatrixXd>::computeInPlace();
extern template void FullPivHouseholderQR<MatrixXd>::computeInPlace();
extern template JacobiSVD<MatrixXd>& JacobiSVD<MatrixXd>::compute(const MatrixXd&, unsigned int);
extern template SelfAdjointEigenSolver<MatrixXd>& SelfAdjointEigenSolver<MatrixXd>::compute(
    const EigenBase<MatrixXd>&, int);

}  // namespace Eigen

namespace plumb {

/// As m.inverse(), for any square m. Thread-safe, as all of these are.
Eigen::MatrixXd Inverse(const Eigen::MatrixXd& m);

/// Of the matrix Q that a QR decomposition makes as a product: FirstColumns(qr.householderQ(), n).
Eigen::MatrixXd FirstColumns(
    const Eigen::HouseholderQR<Eigen::MatrixXd>::HouseholderSequenceType& q, Eigen::Index columns);

}  // namespace plumb
