#pragma once

namespace plumb {

/// Three numbers and what mechanics does with them. Real is double or a pack. Plain data, as all of
/// this file: not thread-safe.
template <class Real>
struct Vector {
  Real x, y, z;

  friend Vector operator+(const Vector& a, const Vector& b) {
    return {a.x + b.x, a.y + b.y, a.z + b.z};
  }
  friend Vector operator-(const Vector& a, const Vector& b) {
    return {a.x - b.x, a.y - b.y, a.z - b.z};
  }
  friend Vector operator*(const Real& s, const Vector& a) { return {s * a.x, s * a.y, s * a.z}; }
  void operator+=(const Vector& b) { x += b.x, y += b.y, z += b.z; }
  Real Dot(const Vector& b) const { return x * b.x + y * b.y + z * b.z; }
  Vector Cross(const Vector& b) const {
    return {y * b.z - z * b.y, z * b.x - x * b.z, x * b.y - y * b.x};
  }
  template <class Other>
  static Vector From(const Other* numbers) {
    Vector vector{};
    vector.x += numbers[0], vector.y += numbers[1], vector.z += numbers[2];
    return vector;
  }
};

/// A rotation by its columns: the axes it makes of x, y and z.
template <class Real>
struct Rotation {
  Vector<Real> x, y, z;

  Vector<Real> operator*(const Vector<Real>& a) const { return a.x * x + a.y * y + a.z * z; }
  Rotation operator*(const Rotation& b) const { return {*this * b.x, *this * b.y, *this * b.z}; }
};

/// A symmetric matrix.
template <class Real>
struct Symmetric {
  Real xx, yy, zz, xy, xz, yz;

  Vector<Real> operator*(const Vector<Real>& a) const {
    return {xx * a.x + xy * a.y + xz * a.z, xy * a.x + yy * a.y + yz * a.z,
            xz * a.x + yz * a.y + zz * a.z};
  }
  void operator+=(const Symmetric& b) {
    xx += b.xx, yy += b.yy, zz += b.zz, xy += b.xy, xz += b.xz, yz += b.yz;
  }
};

}  // namespace plumb
