// Parts of the compiled module _v3d. Each function defines the classes of one topic.
#pragma once

#include <pybind11/pybind11.h>

#include <filesystem>
#include <optional>
#include <string>

#include "base/geometry/camera_model.h"
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

}  // namespace v3d::python
