// The compiled module _v3d of the Python package v3d: takes, and the translation of errors.
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <exception>
#include <map>

#include "base/core/error.h"
#include "bindings.h"
#include "take/ledger/ledger.h"

namespace v3d::python {
namespace {

namespace fs = std::filesystem;

/// A take on disk. The Python lock protects it.
class Take {
 public:
  explicit Take(const fs::path& folder) : paths_{folder}, info_(take::load_take_info(paths_)) {}

  const take::TakePaths& paths() const { return paths_; }
  const take::TakeInfo& info() const { return info_; }

  /// All cameras of calib.toml, in its order.
  const Rig& rig() {
    if (!rig_) rig_ = take::load_take_calib(paths_);
    return *rig_;
  }
  const RigCamera& camera(const std::string& name) {
    const int index = find_camera(rig(), name);
    if (index < 0) throw InputError(paths_.calib().string() + ": no calibration of " + name);
    return rig()[static_cast<size_t>(index)];
  }

 private:
  take::TakePaths paths_;
  take::TakeInfo info_;
  std::optional<Rig> rig_;
};

void bind_take(py::module_& module) {
  py::class_<Take>(module, "Take", "A recorded take: a folder with take.toml.")
      .def(py::init<fs::path>(), py::arg("folder"),
           "Opens a take. Raises InputError for a folder that is no take.")
      .def_property_readonly("path", [](const Take& t) { return t.paths().folder; })
      .def_property_readonly("name", [](const Take& t) { return text_of(t.info().name); })
      .def_property_readonly("studio", [](const Take& t) { return text_of(t.info().studio); })
      .def_property_readonly(
          "rate_hz", [](const Take& t) { return t.info().rate_hz; }, "Pulses per second.")
      .def_property_readonly(
          "pulses", [](const Take& t) { return t.info().pulses; },
          "Number of commanded pulses, which count from 0.")
      .def_property_readonly(
          "state", [](const Take& t) { return py::str(std::string(name(t.info().state))); },
          "'recording', 'complete' or 'recovered'.")
      .def_property_readonly(
          "started_ns", [](const Take& t) { return t.info().started.time_since_epoch().count(); },
          "Start of the recording, nanoseconds since 1970.")
      .def_property_readonly(
          "camera_names", [](const Take& t) { return t.info().cameras; },
          "Names of the cameras that took part.")
      .def_property_readonly(
          "cameras",
          [](Take& t) {
            py::dict cameras;
            for (const RigCamera& camera : t.rig()) cameras[text_of(camera.name)] = camera;
            return cameras;
          },
          "All calibrated cameras by name (calib.toml).")
      .def_property_readonly(
          "ledger", [](const Take& t) { return take::load_ledger(t.paths().ledger()); },
          "The account of pulses and frames, from ledger.toml, which each access reads again.")
      .def(
          "frames",
          [](Take& t, const std::string& camera, int64_t begin, std::optional<int64_t> end,
             bool masks) {
            return open_frames(t.paths(), t.camera(camera), range_of(begin, end), masks);
          },
          py::arg("camera"), py::arg("begin") = 0, py::arg("end") = py::none(), py::kw_only(),
          py::arg("masks") = false,
          "The frames of a camera, of the pulses begin to end - 1. `masks`: with silhouettes.")
      .def(
          "meshes",
          [](const Take& t, int64_t begin, std::optional<int64_t> end,
             const std::optional<fs::path>& file) {
            return open_meshes(t.paths(), file, range_of(begin, end));
          },
          py::arg("begin") = 0, py::arg("end") = py::none(), py::kw_only(),
          py::arg("file") = py::none(),
          "The meshes of mesh.v3d, or of `file`, of the pulses begin to end - 1.")
      .def(
          "motion",
          [](const Take& t, const std::optional<fs::path>& file) {
            return open_motion(file.value_or(t.paths().motion()));
          },
          py::kw_only(), py::arg("file") = py::none(),
          "The tracked surfaces of motion.v3d, or of `file`.")
      .def("__repr__", [](const Take& t) {
        return text_of("<v3d.Take " + t.info().name + ", " + std::to_string(t.info().pulses) +
                       " pulses, " + std::to_string(t.info().cameras.size()) + " cameras>");
      });
}

/// InputError becomes v3d.InputError with the same line.
void bind_errors(py::module_& module) {
  static PyObject* input_error = nullptr;
  input_error = PyErr_NewExceptionWithDoc(
      "v3d.InputError", "Bad input. The text is one line: what is wrong, and what would be right.",
      PyExc_ValueError, nullptr);
  if (input_error == nullptr) throw py::error_already_set();
  module.add_object("InputError", input_error);
  py::register_exception_translator([](std::exception_ptr pointer) {
    try {
      if (pointer) std::rethrow_exception(pointer);
    } catch (const InputError& error) {
      PyErr_SetObject(input_error, text_of(error.what()).ptr());
    }
  });
}

PyObject* new_object(PyTypeObject* type, PyObject* arguments, PyObject* options) {
  return py::detail::pybind11_object_new(type, arguments, options);
}

/// Makes Take.__new__(Take) a TypeError. It would return an object without a C++ value, whose use
/// ends the interpreter. Python rejects the __new__ that a class inherits when the class has
/// another tp_new than its base; a call of the class uses tp_new itself.
void reject_new(const py::module_& module) {
  PyObject* const base = py::detail::get_internals().instance_base;
  for (const auto& [name, value] : module.attr("__dict__").cast<py::dict>()) {
    if (!PyType_Check(value.ptr())) continue;
    auto* const type = reinterpret_cast<PyTypeObject*>(value.ptr());
    if (PyType_IsSubtype(type, reinterpret_cast<PyTypeObject*>(base)) != 0) {
      type->tp_new = new_object;
    }
  }
}

}  // namespace

py::str text_of(const std::string& text) {
  PyObject* const decoded = PyUnicode_DecodeUTF8(text.data(), std::ssize(text), "surrogateescape");
  if (decoded == nullptr) throw py::error_already_set();
  return py::reinterpret_steal<py::str>(decoded);
}

take::FrameRange range_of(int64_t begin, std::optional<int64_t> end) {
  take::FrameRange range{.begin = begin};
  if (end) range.end = *end;
  return range;
}

PYBIND11_MODULE(_v3d, module) {
  module.doc() = "Compiled part of the package v3d.";
  module.attr("__version__") = V3D_VERSION;
  bind_errors(module);
  bind_cameras(module);
  bind_ledger(module);
  bind_frames(module);
  bind_meshes(module);
  bind_motion(module);
  bind_take(module);
  reject_new(module);
}

}  // namespace v3d::python
