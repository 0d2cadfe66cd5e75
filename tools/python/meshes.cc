// Reconstructed meshes of a take in Python.
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <algorithm>
#include <iterator>
#include <mutex>

#include "base/core/error.h"
#include "bindings.h"
#include "daemon/recorded/mesh_frames.h"
#include "recon/pipeline/compact_frame.h"

namespace v3d::python {

using recon::CompactFrame;

/// Reader of the meshes of a take in a range of pulses.
class TakeMeshes {
 public:
  TakeMeshes(const std::filesystem::path& file, recorded::MeshFrames meshes, take::FrameRange range)
      : file_(file), meshes_(std::move(meshes)), all_(meshes_.frames({})) {
    std::ranges::copy_if(all_, std::back_inserter(pulses_),
                         [&](int64_t pulse) { return range.contains(pulse); });
  }

  const std::vector<int64_t>& pulses() const { return pulses_; }
  bool is_unfinished() const { return meshes_.is_unfinished(); }
  /// Throws InputError for a pulse without a mesh, and for a damaged one.
  CompactFrame read(int64_t pulse) {
    if (!std::ranges::binary_search(all_, pulse)) {
      throw InputError(file_.string() + ": no mesh of pulse " + std::to_string(pulse) +
                       "; it has pulses " + std::to_string(all_.front()) + " to " +
                       std::to_string(all_.back()));
    }
    const std::lock_guard lock(mutex_);
    return meshes_.read(pulse);
  }

 private:
  std::filesystem::path file_;
  std::mutex mutex_;
  recorded::MeshFrames meshes_;
  std::vector<int64_t> all_;     ///< ascending
  std::vector<int64_t> pulses_;  ///< those of the range
};

py::object open_meshes(const take::TakePaths& paths,
                       const std::optional<std::filesystem::path>& file, take::FrameRange range) {
  return py::cast(without_python([&] {
    return std::make_shared<TakeMeshes>(
        file.value_or(paths.mesh()),
        file ? recorded::MeshFrames(paths.folder, *file) : recorded::MeshFrames(paths.folder),
        range);
  }));
}

namespace {

/// Read-only array of rows that a mesh, a Python object, owns.
template <class T, class Row>
py::array rows_of(const std::vector<Row>& rows, const py::object& owner) {
  auto [data, shape] = triples<T>(rows);
  return view_of(data, std::move(shape), owner);
}

const CompactFrame& frame_of(const py::object& self) { return self.cast<const CompactFrame&>(); }

void bind_mesh(py::module_& module) {
  py::class_<CompactFrame, std::shared_ptr<CompactFrame>>(
      module, "Mesh", "The coloured mesh of one pulse. Its arrays are read-only views.")
      .def_readonly("pulse", &CompactFrame::pulse)
      .def_property_readonly(
          "exposure_ns",
          [](const CompactFrame& f) { return f.exposure.time_since_epoch().count(); },
          "Start of the exposure, nanoseconds since 1970; 0: unknown.")
      .def_property_readonly(
          "cameras",
          [](const CompactFrame& f) {
            py::list names;
            for (const std::string& camera : f.cameras) names.append(text_of(camera));
            return names;
          },
          "Names of the cameras that took part.")
      .def_readonly("missing_cameras", &CompactFrame::missing)
      .def_readonly("quality", &CompactFrame::quality, "0 to 1, more is better; NaN: unknown.")
      .def_property_readonly(
          "vertices",
          [](const py::object& self) { return rows_of<float>(frame_of(self).mesh.vertices, self); },
          "float32 [vertices, 3]: world, metres, z up.")
      .def_property_readonly(
          "triangles",
          [](const py::object& self) {
            return rows_of<uint32_t>(frame_of(self).mesh.triangles, self);
          },
          "uint32 [triangles, 3]: counter-clockwise seen from outside.")
      .def_property_readonly(
          "colours",
          [](const py::object& self) -> py::object {
            const Mesh& mesh = frame_of(self).mesh;
            if (mesh.colours.empty() && !mesh.vertices.empty()) return py::none();
            return rows_of<uint8_t>(mesh.colours, self);
          },
          "uint8 [vertices, 3]: sRGB; None for a mesh without colours.")
      .def_property_readonly(
          "performers",
          [](const py::object& self) -> py::object {
            const std::vector<uint8_t>& performers = frame_of(self).performers;
            if (performers.empty()) return py::none();
            return view_of(performers.data(), {std::ssize(performers)}, self);
          },
          "uint8 [vertices]: performer, 0: unknown; None when not stated.")
      .def("__repr__", [](const CompactFrame& f) {
        return text_of("<v3d.Mesh, pulse " + std::to_string(f.pulse) + ", " +
                       std::to_string(f.mesh.vertices.size()) + " vertices, " +
                       std::to_string(f.mesh.triangles.size()) + " triangles>");
      });
}

}  // namespace

void bind_meshes(py::module_& module) {
  bind_mesh(module);
  using Meshes = std::shared_ptr<TakeMeshes>;
  bind_iterator<TakeMeshes>(module, "MeshIterator", [](TakeMeshes& meshes, int64_t pulse) {
    return std::optional(meshes.read(pulse));
  });
  py::class_<TakeMeshes, Meshes>(module, "Meshes",
                                 "The meshes of a take. Reading is fast in ascending order.")
      .def_property_readonly(
          "pulses", [](const TakeMeshes& m) { return array_of(m.pulses()); },
          "Pulses that have a mesh, ascending.")
      .def_property_readonly("unfinished", &TakeMeshes::is_unfinished,
                             "True when the file has no index, because its writer did not finish.")
      .def(
          "read", [](TakeMeshes& m, int64_t pulse) { return m.read(pulse); }, py::arg("pulse"),
          py::call_guard<py::gil_scoped_release>(),
          "The mesh of a pulse. Raises InputError when it is missing or damaged.")
      .def("__len__", [](const TakeMeshes& m) { return m.pulses().size(); })
      .def("__iter__", [](const Meshes& m) { return PulseIterator<TakeMeshes>{m}; });
}

}  // namespace v3d::python
