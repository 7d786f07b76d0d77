#pragma once

#include <bit>
#include <cmath>
#include <cstdint>
#include <type_traits>

namespace plumb {

/// N doubles side by side: N simulations that go through the same equations together. Operators are
/// GCC's, one IEEE operation per element, so that every element has the bits a double on its own
/// would have. Functions here are pure, but for the writing Lane: thread-safe.
template <int N>
struct PackOf {
  typedef double Type __attribute__((vector_size(N * sizeof(double))));
};
template <int N>
using Pack = typename PackOf<N>::Type;

/// The rest is the same for double and for packs. Comparisons give a Mask; mask ? a : b chooses
/// by element.
template <class Real>
using Mask = decltype(Real() < Real());

template <class Real>
inline constexpr int kLanes = static_cast<int>(sizeof(Real) / sizeof(double));

template <class Real>
double& Lane(Real& x, int lane) {
  return reinterpret_cast<double*>(&x)[lane];
}
template <class Real>
double Lane(const Real& x, int lane) {
  return reinterpret_cast<const double*>(&x)[lane];
}

template <class M>
bool Any(const M& mask) {
  if constexpr (std::is_arithmetic_v<M>) {
    return mask;
  } else {
    int64_t any = 0;
    for (size_t i = 0; i < sizeof(M) / sizeof(int64_t); ++i) any |= mask[i];
    return any != 0;
  }
}

template <class Real>
Real Max(const Real& a, const Real& b) {
  return a > b ? a : b;
}
template <class Real>
Real Abs(const Real& x) {
  return x < 0 ? -x : x;
}
/// NaN passes, unlike through Eigen's min and max.
template <class Real>
Real Clamp(const Real& x, const Real& lower, const Real& upper) {
  const Real raised = x < lower ? lower : x;
  return raised > upper ? upper : raised;
}
template <class Real>
Real Sqrt(const Real& x) {
  Real root = x;
  for (int i = 0; i < kLanes<Real>; ++i) Lane(root, i) = std::sqrt(Lane(x, i));
  return root;
}

namespace internal {

/// Up to kFar rad, where the reduction is exact enough.
inline constexpr double kFar = 1e5;

template <class Real>
inline __attribute__((always_inline)) void SinCosNear(const Real& x, Real* sine, Real* cosine) {
  constexpr double kTwoOverPi = 0.63661977236758134308;
  // pi/2 = first + second + third; the first two have 33 bits, so that k times them is exact.
  // fdlibm's e_rem_pio2.c.
  constexpr double kFirst = 1.57079632673412561417e+00, kSecond = 6.07710050630396597660e-11,
                   kThird = 2.02226624879595063154e-21;
  constexpr double kRound = 6755399441055744.0;  // 1.5 * 2^52: adding it rounds to an integer
  const Real shifted = x * kTwoOverPi + kRound;
  const Real k = shifted - kRound;
  const Real r = ((x - k * kFirst) - k * kSecond) - k * kThird;
  const Real z = r * r;
  const Real s =
      r + r * z *
              (-1.66666666666666324348e-01 +
               z * (8.33333333332248946124e-03 +
                    z * (-1.98412698298579493134e-04 +
                         z * (2.75573137070700676789e-06 + z * (-2.50507602534068634195e-08 +
                                                                z * 1.58969099521155010221e-10)))));
  const Real c =
      (1 - 0.5 * z) +
      z * z *
          (4.16666666666666019037e-02 +
           z * (-1.38888888888741095749e-03 +
                z * (2.48015872894767294178e-05 +
                     z * (-2.75573143513906633035e-07 +
                          z * (2.08757232129817482790e-09 + z * -1.13596475577881948265e-11)))));
  if constexpr (std::is_same_v<Real, double>) {
    const auto quadrant = std::bit_cast<int64_t>(shifted);
    const double first = quadrant & 1 ? c : s, second = quadrant & 1 ? s : c;
    *sine = quadrant & 2 ? -first : first;
    *cosine = (quadrant + 1) & 2 ? -second : second;
  } else {
    using Integers = Mask<Real>;
    const Integers quadrant = (Integers)shifted;  // NOLINT: GCC's way to see a vector's bits
    const Integers odd = (quadrant & 1) != 0;
    const Real first = odd ? c : s, second = odd ? s : c;
    *sine = (quadrant & 2) != 0 ? -first : first;
    *cosine = ((quadrant + 1) & 2) != 0 ? -second : second;
  }
}

// The far lanes only: the near ones keep their own bits whoever is beside them.
template <class Real>
__attribute__((noinline)) void SinCosFar(const Real& x, Real* sine, Real* cosine) {
  for (int i = 0; i < kLanes<Real>; ++i) {
    const double angle = Lane(x, i);
    double s = std::sin(angle), c = std::cos(angle);
    if (std::abs(angle) <= kFar) SinCosNear(angle, &s, &c);
    Lane(*sine, i) = s, Lane(*cosine, i) = c;
  }
}

}  // namespace internal

/// Sine and cosine to 1e-16, without branches up to 1e5 rad: Cody and Waite's reduction by
/// multiples of pi/2 in three parts, then the polynomials of fdlibm's k_sin.c and k_cos.c (Sun
/// Microsystems, 1993). Of our own, because a library's vector sine has other bits than its scalar
/// one.
template <class Real>
inline __attribute__((always_inline)) void SinCos(const Real& x, Real* sine, Real* cosine) {
  if (Any(Abs(x) > internal::kFar)) [[unlikely]] {
    internal::SinCosFar(x, sine, cosine);
  } else {
    internal::SinCosNear(x, sine, cosine);
  }
}

}  // namespace plumb
