#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <memory>
#include <optional>
#include <vector>

#include "common/random.h"
#include "robot/residual_kernels.h"

namespace plumb {

/// A matrix in single precision for residual_kernels, its columns filled up with zeros to packs.
/// Const use is thread-safe.
class PackedMatrix {
 public:
  PackedMatrix() = default;
  explicit PackedMatrix(const Eigen::MatrixXd& matrix);

  const residual_kernels::Pack* data() const { return data_.data(); }
  int packs() const { return packs_; }  ///< of each column
  int rows() const { return packs_ * residual_kernels::Pack::kSize; }
  int columns() const { return columns_; }

 private:
  int packs_ = 0, columns_ = 0;
  std::vector<residual_kernels::Pack> data_;
};

/// The change of n quantities in a control step beyond the simulator's, as a function of D inputs,
/// learnt from recorded transitions: the discrepancy function of
/// Kennedy and O'Hagan (J. R. Statist. Soc. B 63, 2001), a Gaussian process with a squared
/// exponential kernel and a linear one, by M of its inputs ("subset of regressors":
/// Quinonero-Candela and Rasmussen, JMLR 6, 2005):
///   phi(x) = (1, z / sqrt(D), exp(-|z - c_m|^2 / 2)),   z = (x - mean) / scale,
///   change = W phi(x) + sqrt(u(x)) unknown h + L e,   h, e ~ N(0, 1), h once an episode.
/// u is the share of the kernel's variance that the recorded inputs leave open (ibid.,
/// "deterministic training conditional"): 0 where the residual is known, 1 far away. There only the
/// plane is left, of a z that is kept within what was recorded, and what an episode has drawn.
/// Without that, a policy seeks out inputs where what has been learnt is wrong in its favour.
/// Without the noise a change stays within `bound`: where nothing is known nothing grows. Immutable
/// use is thread-safe.
struct ResidualFunction {
  Eigen::VectorXd mean, scale;  ///< D, of the inputs; scale > 0: the kernel's length
  Eigen::VectorXd low, high;    ///< D, least and greatest z recorded
  Eigen::MatrixXd centres;      ///< M x D, in units of z
  /// W of each draw, n x (1 + D + M) [rad or m, rad/s or m/s]
  std::vector<Eigen::MatrixXd> weights;
  Eigen::MatrixXd noise;    ///< n x n, L: what is left, and is not the readings'
  Eigen::VectorXd bound;    ///< n, > 0
  Eigen::VectorXd unknown;  ///< n, >= 0: sd of a change where nothing is known

  Eigen::Index inputs() const { return mean.size(); }
  Eigen::Index outputs() const { return noise.rows(); }
  Eigen::Index features() const { return 1 + mean.size() + centres.rows(); }

  /// What Features needs to be fast, in single precision, as all of it is known: M' is M and what
  /// fills up the last pack. Not thread-safe.
  struct Work {
    PackedMatrix centres;          ///< M' x D
    Eigen::VectorXf half_squares;  ///< M', of the centres' lengths
    Eigen::VectorXf z;             ///< D
    Eigen::VectorXf features;      ///< 1 + D + M': phi(x), and no meaning
  };
  Work MakeWork() const;
  /// Writes phi(x) into work->features. Does not allocate.
  void Features(const Eigen::Ref<const Eigen::VectorXd>& x, Work* work) const;

  /// The lower Cholesky factor of the kernel between the centres, its 1 made 1 + kNugget, which
  /// keeps it well conditioned.
  Eigen::MatrixXd KernelFactor() const;
  static constexpr double kNugget = 1e-3;
  /// More would be no residual but an attack: their kernel is factorised.
  static constexpr int kMostCentres = 2000;
  static constexpr int kMostChannels = 10'000;  ///< inputs, outputs
  /// In units of z: what is beyond was never recorded, and its square is infinite in single
  /// precision.
  static constexpr double kFarthest = 1e6;
  /// [rad, m, rad/s, m/s] what no simulator lacks in a step: bound, noise and unknown are less.
  static constexpr double kMostChange = 1000;
};

/// What a simulator lacks, for some draws of its parameters: each of them has its own functions, as
/// what is lacking depends on what the parameters explain. Contact is what simulators have wrong
/// most, and its errors must not be smeared over the rest; and what a contact has wrong it can only
/// do to the robot as an impulse there, along M^-1 J'. So there is a function of each contact with
/// the ground and one of each joint at a stop, which know nothing but that contact
/// (StepContacts::Contact), one of what these leave of steps that touch, and one of free steps.
/// Where there is no function, the simulator is right as it is. Immutable use is thread-safe.
struct Residual {
  std::vector<Eigen::VectorXd> coordinates;  ///< of the parameters, of each draw; at least one
  /// Of 2 n outputs, all positions and velocities, by ResidualInputs: of steps that touch nothing,
  /// and of those that touch the ground or a stop.
  std::optional<ResidualFunction> free, touching;
  /// Of 2 k outputs, the displacement and the velocity of a contact point (upwards, and along the
  /// ground) or of a joint away from its stop.
  std::optional<ResidualFunction> ground, stop;
  /// [m], [rad] as near to the ground or a stop as this is touching: states are not known better
  double margin = kTouchMargin;

  static constexpr double kTouchMargin = 0.0078125;  // 2^-7: the same in single precision

  /// Its functions, in the order of residual_function_t's conditions, and of what they are.
  struct Part {
    const char* name;
    std::optional<ResidualFunction> Residual::*function;
    bool of_contacts;  ///< not of the whole robot
  };
  static const std::array<Part, 4> kParts;
  /// Whether it has a function at all.
  bool any() const { return free || touching || ground || stop; }
};

/// @throws std::invalid_argument naming the field that is not finite, not positive where it has to
/// be, or larger than what a simulator can lack. Thread-safe.
void RequirePlausible(const Residual& residual);

/// A residual as one episode has it. Not thread-safe; does not allocate after construction.
class ResidualSample {
 public:
  /// @param residual must outlive this.
  explicit ResidualSample(const Residual& residual);

  /// Begins an episode. @param draw < residual.coordinates.size(). @param random for its noise.
  void Begin(size_t draw, Random& random);
  // Changes in a control step: zero where there is no function. Valid until the next call.
  /// Of positions and velocities, 2 n entries. @param x see ResidualInputs.
  const Eigen::VectorXd& Step(bool touching, const Eigen::Ref<const Eigen::VectorXd>& x) {
    return Change(touching ? touching_ : free_, x);
  }
  /// Of a contact, 2 k entries. @param x see StepContacts::Contact.
  const Eigen::VectorXd& Contact(bool ground, const Eigen::Ref<const Eigen::VectorXd>& x) {
    return Change(ground ? ground_ : stop_, x);
  }

 private:
  // A function at work; without one all but its change, of zeros, is empty.
  struct Part {
    const ResidualFunction* function = nullptr;
    ResidualFunction::Work work;
    std::vector<PackedMatrix> weights;
    PackedMatrix whitening;  // the kernel factor's inverse
    Eigen::VectorXf known, whitened;
    Eigen::VectorXd lasting;  // of the episode: h
    Eigen::VectorXd normal, change;
    bool noisy = false;
  };
  static Part Prepare(const std::optional<ResidualFunction>& function, Eigen::Index outputs);
  const Eigen::VectorXd& Change(Part& part, const Eigen::Ref<const Eigen::VectorXd>& x);

  size_t draw_ = 0;
  Random random_{0};
  Part free_, touching_, ground_, stop_;
};

}  // namespace plumb
