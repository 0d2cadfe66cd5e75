// Python iterators over the pulses of a reader.
#pragma once

#include <pybind11/pybind11.h>

#include <memory>
#include <optional>

#include "bindings.h"

namespace v3d::python {

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
