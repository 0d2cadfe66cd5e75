// numpy arrays of the data of C++ objects.
#pragma once

#include <pybind11/numpy.h>

#include <cstdint>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "base/image/image.h"
#include "base/image/mask.h"

namespace v3d::python {

namespace py = pybind11;

using Shape = std::vector<py::ssize_t>;

/// Makes the array read-only, because it shows data of another object.
inline py::array read_only(py::array array) {
  array.attr("setflags")(py::arg("write") = false);
  return array;
}

/// A read-only array of data that `owner`, a Python object, holds. No copy; the array keeps `owner`
/// alive. Requires: `data` has as many elements as `shape`, and stays in place.
template <class T>
py::array view_of(const T* data, Shape shape, const py::object& owner) {
  return read_only(py::array_t<T>(std::move(shape), data, owner));
}

/// An array that takes over `values`. No copy. Requires as many elements as `shape` has.
template <class T>
py::array array_of(std::vector<T> values, Shape shape) {
  auto kept = std::make_unique<std::vector<T>>(std::move(values));
  const T* const data = kept->data();
  const py::capsule owner(kept.get(), [](void* it) { delete static_cast<std::vector<T>*>(it); });
  static_cast<void>(kept.release());
  return py::array_t<T>(std::move(shape), data, owner);
}

/// A new array with one dimension.
template <class T>
py::array array_of(std::vector<T> values) {
  const auto size = std::ssize(values);
  return array_of(std::move(values), {size});
}

/// Rows of three elements, such as positions and triangles: the shape and the first element.
/// Requires: the rows have no padding.
template <class T, class Row>
std::pair<const T*, Shape> triples(const std::vector<Row>& rows) {
  static_assert(sizeof(Row) == 3 * sizeof(T));
  return {reinterpret_cast<const T*>(rows.data()), {std::ssize(rows), 3}};
}

/// A copy of rows of three elements.
template <class T, class Row>
py::array copied_triples(const std::vector<Row>& rows) {
  const auto [data, shape] = triples<T>(rows);
  return py::array_t<T>(shape, data);
}

/// [height, width], or [height, width, 3] for RGB8.
inline Shape shape_of(const Image& image) {
  Shape shape{image.size.height, image.size.width};
  if (image.format == PixelFormat::kRGB8) shape.push_back(3);
  return shape;
}

/// A new array of the pixels of an image. No copy.
inline py::array array_of(Image image) {
  Shape shape = shape_of(image);
  return array_of(std::move(image.bytes), std::move(shape));
}

/// A new boolean array [height, width], true for foreground.
py::array array_of(const Mask& mask);

}  // namespace v3d::python
