#pragma once

#include <fmt/format.h>
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <initializer_list>
#include <span>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "python/native/matrix.h"

// What comes from Python and goes there. With the GIL held.
namespace plumb::python {

namespace py = pybind11;

template <class T>
using Array = py::array_t<T, py::array::c_style | py::array::forcecast>;
constexpr py::ssize_t kAny = -1;  // a length that is not asked for

using Shape = std::span<const py::ssize_t>;

inline std::string ShapeText(Shape shape) {
  std::vector<std::string> lengths;
  for (const py::ssize_t length : shape)
    lengths.push_back(length == kAny ? "any" : std::to_string(length));
  return fmt::format("({}{})", fmt::join(lengths, ", "), shape.size() == 1 ? "," : "");
}

inline bool Fits(Shape shape, Shape may) {
  return std::equal(
      shape.begin(), shape.end(), may.begin(), may.end(),
      [](py::ssize_t has, py::ssize_t needs) { return needs == kAny || has == needs; });
}

/// Numbers as a C-contiguous array: the object itself where it is one, else a copy.
/// @throws py::value_error naming the argument: it is no array of real numbers, not of one of the
/// shapes, or not finite.
template <class T>
Array<T> Numbers(const char* name, const py::object& object,
                 std::initializer_list<std::initializer_list<py::ssize_t>> shapes,
                 bool finite = true) {
  const py::array given = py::array::ensure(object);
  if (!given) {
    PyErr_Clear();
    throw py::value_error(fmt::format("{}: is no array of numbers", name));
  }
  const char kind = given.dtype().kind();
  if (kind != 'f' && kind != 'i' && kind != 'u' && kind != 'b') {
    throw py::value_error(fmt::format("{}: has dtype {}, needs real numbers", name,
                                      std::string(py::str(given.dtype()))));
  }
  const std::span shape(given.shape(), static_cast<size_t>(given.ndim()));
  if (std::none_of(shapes.begin(), shapes.end(), [&](std::initializer_list<py::ssize_t> may) {
        return Fits(shape, {may.begin(), may.size()});
      })) {
    std::string wanted;
    for (const auto& may : shapes)
      wanted += (wanted.empty() ? "" : " or ") + ShapeText({may.begin(), may.size()});
    throw py::value_error(
        fmt::format("{}: has shape {}, needs {}", name, ShapeText(shape), wanted));
  }
  Array<T> numbers = Array<T>::ensure(given);
  if (!numbers) {
    PyErr_Clear();
    throw py::value_error(fmt::format("{}: is no array of numbers", name));
  }
  if constexpr (std::is_floating_point_v<T>) {
    if (finite &&
        !Eigen::Map<const Eigen::Array<T, Eigen::Dynamic, 1>>(numbers.data(), numbers.size())
             .isFinite()
             .all())
      throw py::value_error(fmt::format("{}: is not finite", name));
  }
  return numbers;
}

template <class T>
Eigen::Map<const Matrix<T>> AsMatrix(const Array<T>& numbers) {
  const py::ssize_t columns = numbers.ndim() == 1 ? 1 : numbers.shape(1);
  return {numbers.data(), numbers.shape(0), columns};
}

inline Array<double> ToArray(const Eigen::VectorXd& numbers) {
  return Array<double>(numbers.size(), numbers.data());
}
inline Array<double> ToArray(const Eigen::MatrixXd& numbers) {
  Array<double> array({numbers.rows(), numbers.cols()});
  Eigen::Map<Matrix<double>>(array.mutable_data(), numbers.rows(), numbers.cols()) = numbers;
  return array;
}

/// A view of memory that `owner` keeps: no copy. Read-only in Python.
template <class T>
py::array View(const T* numbers, const std::vector<py::ssize_t>& shape, const py::handle& owner) {
  py::array array(py::dtype::of<T>(), shape, numbers, owner);
  py::detail::array_proxy(array.ptr())->flags &= ~py::detail::npy_api::NPY_ARRAY_WRITEABLE_;
  return array;
}
template <class T>
py::array View(const Matrix<T>& numbers, const py::handle& owner) {
  return View(numbers.data(), {numbers.rows(), numbers.cols()}, owner);
}
template <class T>
py::array View(const std::vector<T>& numbers, const py::handle& owner) {
  return View(numbers.data(), {static_cast<py::ssize_t>(numbers.size())}, owner);
}
/// Of flags, 0 or 1.
inline py::array View(const std::vector<uint8_t>& flags, const py::handle& owner) {
  return View(reinterpret_cast<const bool*>(flags.data()), {static_cast<py::ssize_t>(flags.size())},
              owner);
}

/// @throws py::value_error naming the argument if the number is not from lower to upper.
template <class T>
T InRange(const char* name, T number, T lower, T upper) {
  if (number >= lower && number <= upper) return number;
  throw py::value_error(fmt::format("{}: is {}, needs {} to {}", name, number, lower, upper));
}

constexpr int kMostThreads = 1024;
/// 0 = as many as the machine has cores.
inline int Threads(int threads) { return InRange("threads", threads, 0, kMostThreads); }

}  // namespace plumb::python
