// Calibrated cameras in Python.
#include <pybind11/eigen.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <limits>

#include "base/config/calib_file.h"
#include "base/core/error.h"
#include "bindings.h"
#include "recon/texture/undistortion.h"

namespace v3d::python {
namespace {

using Points = py::array_t<double, py::array::c_style | py::array::forcecast>;

/// Throws InputError unless `points` has N rows of `columns` numbers.
void check_rows(const Points& points, py::ssize_t columns, const char* argument) {
  if (points.ndim() == 2 && points.shape(1) == columns) return;
  throw InputError(std::string(argument) + ": expected an array of N rows of " +
                   std::to_string(columns) + " numbers, not one of " +
                   std::to_string(points.ndim()) + " dimensions" +
                   (points.ndim() == 2 ? " with rows of " + std::to_string(points.shape(1)) : ""));
}

/// Applies `map` to each row of `In` numbers. Rows without a result become NaN.
template <int In, int Out, class Map>
py::array mapped(const Points& points, const char* argument, const Map& map) {
  check_rows(points, In, argument);
  const py::ssize_t rows = points.shape(0);
  std::vector<double> values(static_cast<size_t>(rows) * Out,
                             std::numeric_limits<double>::quiet_NaN());
  const double* const in = points.data();
  {
    const py::gil_scoped_release others_run;
    for (py::ssize_t row = 0; row < rows; ++row) {
      const auto result = map(Eigen::Map<const Eigen::Vector<double, In>>(in + In * row));
      if (result) Eigen::Map<Eigen::Vector<double, Out>>(values.data() + Out * row) = *result;
    }
  }
  return array_of(std::move(values), {rows, Out});
}

py::array project(const RigCamera& camera, const Points& points) {
  return mapped<3, 2>(points, "points",
                      [&](const Eigen::Vector3d& world) { return camera.model.project(world); });
}

py::array rays(const RigCamera& camera, const Points& pixels) {
  return mapped<2, 3>(pixels, "pixels",
                      [&](const Eigen::Vector2d& pixel) { return camera.model.ray(pixel); });
}

RigCamera pinhole(const RigCamera& camera) {
  return {camera.name, recon::pinhole_of(camera.model, camera.name), camera.colour};
}

Rig read_calib(const std::filesystem::path& path) { return load_calib(path); }

}  // namespace

void bind_cameras(py::module_& module) {
  py::class_<RigCamera>(
      module, "Camera",
      "A calibrated camera with OpenCV's model. Pixels: the centre of the first one is (0, 0).\n"
      "World: metres, z up. Camera frame: x right, y down, z forward.")
      .def_property_readonly("name", [](const RigCamera& c) { return text_of(c.name); })
      .def_property_readonly(
          "size",
          [](const RigCamera& c) { return std::pair(c.model.size().width, c.model.size().height); },
          "Width and height, pixels.")
      .def_property_readonly(
          "matrix", [](const RigCamera& c) { return Eigen::Matrix3d(c.model.matrix()); },
          "[fx skew cx; 0 fy cy; 0 0 1], pixels.")
      .def_property_readonly(
          "distortion",
          [](const RigCamera& c) {
            const Distortion& d = c.model.distortion();
            return array_of(std::vector<double>(d.begin(), d.end()));
          },
          "OpenCV's 14 coefficients: k1 k2 p1 p2 k3 k4 k5 k6 s1 s2 s3 s4 tau_x tau_y.")
      .def_property_readonly(
          "rotation",
          [](const RigCamera& c) { return Eigen::Matrix3d(c.model.cam_from_world().rotation); },
          "R of x_cam = R x_world + t.")
      .def_property_readonly(
          "translation",
          [](const RigCamera& c) { return Eigen::Vector3d(c.model.cam_from_world().translation); },
          "t of x_cam = R x_world + t, metres.")
      .def_property_readonly(
          "centre", [](const RigCamera& c) { return Eigen::Vector3d(c.model.center()); },
          "The optical centre, world, metres.")
      .def("project", &project, py::arg("points"),
           "Pixels [N, 2] of world points [N, 3], also outside the image. NaN for points that the "
           "camera cannot see.")
      .def("rays", &rays, py::arg("pixels"),
           "Unit directions [N, 3], world, of the rays through pixels [N, 2]. NaN where the lens "
           "model has none.")
      .def("pinhole", &pinhole,
           "The camera of Frame.undistorted(): without distortion and skew, its principal point in "
           "the middle.")
      .def("__repr__", [](const RigCamera& c) {
        return text_of("<v3d.Camera " + c.name + ", " + format_size(c.model.size()) + ">");
      });
  module.def("load_calib", &read_calib, py::arg("path"),
             "The cameras of a calibration file, in its order.");
}

}  // namespace v3d::python
