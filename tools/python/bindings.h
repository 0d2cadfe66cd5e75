// Parts of the compiled module _v3d, and what they share: each bind_ function defines the classes
// of one topic; numpy arrays of the data of C++ objects; iterators.
#pragma once

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "base/geometry/camera_model.h"
#include "base/image/image.h"
#include "base/image/mask.h"
#include "take/take.h"

namespace v3d::python {

namespace py = pybind11;

void bind_cameras(py::module_& module);
void bind_frames(py::module_& module);
void bind_ledger(py::module_& module);
void bind_meshes(py::module_& module);
void bind_motion(py::module_& module);

/// Text of the operating system or of a file, which may be no UTF-8, as Python shows such names.
py::str text_of(const std::string& text);

/// Calls `make` while other Python threads run.
template <class Make>
auto without_python(const Make& make) {
  const py::gil_scoped_release others_run;
  return make();
}

/// Pulses `begin` to `end` - 1. Without `end`: to the last pulse.
take::FrameRange range_of(int64_t begin, std::optional<int64_t> end);

// The readers behind a take, as Python objects. Each locks itself: threads may share it, and wait
// for each other. They throw InputError for a file that cannot be opened.

/// v3d.Frames
py::object open_frames(const take::TakePaths& paths, const RigCamera& camera,
                       take::FrameRange range, bool masks);
/// v3d.Meshes. Without `file`: those of the take.
py::object open_meshes(const take::TakePaths& paths,
                       const std::optional<std::filesystem::path>& file, take::FrameRange range);
/// v3d.Motion
py::object open_motion(const std::filesystem::path& file);

// numpy arrays of the data of C++ objects.

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

// Python iterators over the pulses of a reader.

/// Position in the pulses of a reader, which has `pulses()`.
template <class Reader>
struct PulseIterator {
  std::shared_ptr<Reader> reader;
  size_t next = 0;
};

/// Defines the iterator class of a reader. `read(reader, pulse)` returns an optional, empty for
/// pulses to leave out. It runs without the lock of Python. After an exception, the iterator
/// continues with the next pulse.
template <class Reader, class Read>
void bind_iterator(py::module_& module, const char* name, const Read& read) {
  using Iterator = PulseIterator<Reader>;
  py::class_<Iterator>(module, name, "Iterator over pulses.")
      .def(
          "__iter__", [](Iterator& it) -> Iterator& { return it; },
          py::return_value_policy::reference_internal)
      .def("__next__", [read](Iterator& it) {
        while (it.next < it.reader->pulses().size()) {
          const int64_t pulse = it.reader->pulses()[it.next++];
          py::gil_scoped_release others_run;
          if (auto result = read(*it.reader, pulse)) return *std::move(result);
        }
        throw py::stop_iteration();
      });
}

}  // namespace v3d::python
