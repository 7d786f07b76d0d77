#pragma once

#include <cstddef>

#include "sim/dynamics/real.h"

namespace plumb {

/// Velocities that move something: the last, and before each the next, down to -1.
struct Chain {
  int last;
  const int* before;
};

/// A place where something touches, as Constraints' trials leave it. Row 0 is along the normal, the
/// others along the surface; arrays have an unused entry for it. Plain data, not thread-safe.
template <class Real, size_t kRows>
struct Contact {
  /// In space what is foreseen to slide has its full force, whatever speed is left.
  static constexpr bool kSlides = kRows == 3;

  Chain chain;         ///< of what moves it
  bool any;            ///< active in some lane
  bool near;           ///< may become so
  Mask<Real> active;   ///< pushes
  Real depth;          ///< [m] where forces are evaluated
  Real pressure;       ///< [N] normal force of the latest trial
  Real speed;          ///< [m/s] along the surface, then
  Real along[kRows];   ///< and which way: of length one
  Real rubbed[kRows];  ///< [N] friction in that trial, against the motion
  Real grip;           ///< [N s/m] what makes it: per speed, where it sticks
  Real pushed[kRows];  ///< [N] where it slides, the full force
  Real aside;          ///< [N s/m] and across it per speed, as friction turns with the motion,
  Real across[kRows];  ///< in this direction, of length one
  Real outcome;        ///< [m/s] speed that friction will leave

  static Real Length(const Real* vector) {
    Real squared{};
    for (size_t t = 1; t < kRows; ++t) squared += vector[t] * vector[t];
    return Sqrt(squared);
  }

  /// Whether it slides or sticks in the trial to come. @param full [N] friction.
  void Grip(const Real& full, const Real& slip_speed) {
    grip = full / outcome;
    if constexpr (kSlides) {
      const Mask<Real> slides = outcome > slip_speed;
      aside = slides ? grip : Real{};
      grip = slides ? Real{} : grip;
      for (size_t t = 1; t < kRows; ++t) pushed[t] = slides ? Real(full * along[t]) : Real{};
      across[1] = Real{} - along[2];
      across[2] = along[1];
    }
  }

  /// What friction is at velocities [m/s] along the surface, which the trial has come to.
  /// @return [W] power of what should slide: negative where it moves the other way.
  Real Rub(const Real* velocity) {
    Real power{}, turn{};
    for (size_t t = 1; kSlides && t < kRows; ++t) {
      power += pushed[t] * velocity[t];
      turn += across[t] * velocity[t];
    }
    for (size_t t = 1; t < kRows; ++t) {
      rubbed[t] = grip * velocity[t];
      if (kSlides) rubbed[t] += pushed[t] + aside * turn * across[t];
    }
    speed = Length(velocity);
    for (size_t t = 1; t < kRows; ++t) along[t] = speed > 0 ? Real(velocity[t] / speed) : Real{};
    return power;
  }
};

}  // namespace plumb
