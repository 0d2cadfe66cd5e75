#include "base/config/calib_file.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <string>
#include <vector>

#include "base/config/toml_file.h"
#include "base/core/error.h"
#include "base/core/text.h"
#include "base/io/file.h"

namespace v3d {
namespace {

ImageSize read_size(const TomlTable& camera) {
  const std::vector<double> size = camera.numbers("size");  // Pose2Sim writes 1024.0
  const auto fits = [](double n) { return n > 0 && n <= kMaxImageSide && n == std::floor(n); };
  if (size.size() != 2 || !fits(size[0]) || !fits(size[1])) {
    camera.fail("size", "expected [width, height] in pixels, each from 1 to " +
                            std::to_string(kMaxImageSide));
  }
  return {static_cast<int>(size[0]), static_cast<int>(size[1])};
}

/// Rejects numbers far beyond any real camera: they come from damaged files, and their products
/// overflow.
void check_limits(const TomlTable& camera, std::string_view key, const std::vector<double>& row) {
  constexpr double kMax = 1e6;
  const bool fits = std::ranges::all_of(row, [](double n) { return std::abs(n) <= kMax; });
  if (!fits) camera.fail(key, "expected numbers from -1,000,000 to 1,000,000");
}

Eigen::Matrix3d read_3x3(const TomlTable& camera, std::string_view key) {
  const auto rows = camera.rows(key);
  for (const auto& row : rows) check_limits(camera, key, row);
  const bool is_3x3 = rows.size() == 3 && std::all_of(rows.begin(), rows.end(),
                                                      [](const auto& r) { return r.size() == 3; });
  if (!is_3x3) {
    camera.fail(key, "expected 3 rows of 3 numbers");
  }
  Eigen::Matrix3d m;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      m(i, j) = rows[i][j];
    }
  }
  return m;
}

Eigen::Matrix3d read_matrix(const TomlTable& camera) {
  const Eigen::Matrix3d k = read_3x3(camera, "matrix");
  if (!(k(0, 0) > 0 && k(1, 1) > 0) || k(1, 0) != 0 || k.row(2) != Eigen::RowVector3d(0, 0, 1)) {
    camera.fail("matrix", "expected [[fx, skew, cx], [0, fy, cy], [0, 0, 1]] with fx, fy > 0");
  }
  return k;
}

Distortion read_distortion(const TomlTable& camera) {
  const std::vector<double> coefficients = camera.numbers("distortions");
  constexpr std::array<size_t, 6> kLengths = {0, 4, 5, 8, 12, 14};
  if (std::find(kLengths.begin(), kLengths.end(), coefficients.size()) == kLengths.end()) {
    camera.fail("distortions", "expected 0, 4, 5, 8, 12 or 14 numbers in OpenCV's order, found " +
                                   std::to_string(coefficients.size()));
  }
  check_limits(camera, "distortions", coefficients);
  Distortion distortion{};
  std::copy(coefficients.begin(), coefficients.end(), distortion.begin());
  return distortion;
}

Eigen::Vector3d read_vector(const TomlTable& camera, std::string_view key) {
  const std::vector<double> v = camera.numbers(key);
  if (v.size() != 3) {
    camera.fail(key, "expected 3 numbers, found " + std::to_string(v.size()));
  }
  check_limits(camera, key, v);
  return {v[0], v[1], v[2]};
}

ColourResponse read_colour(const TomlTable& camera) {
  ColourResponse colour;
  if (camera.has("colour_black")) colour.black = read_vector(camera, "colour_black");
  if (camera.has("colour_matrix")) colour.matrix = read_3x3(camera, "colour_matrix");
  return colour;
}

RigidTransform read_cam_from_world(const TomlTable& camera) {
  const Eigen::Vector3d translation = read_vector(camera, "translation");
  if (!camera.is_array_of_arrays("rotation")) {
    return RigidTransform::from_rodrigues(read_vector(camera, "rotation"), translation);
  }
  constexpr double kRounding = 1e-6;
  const Eigen::Matrix3d rotation = read_3x3(camera, "rotation");
  if (!rotation.isUnitary(kRounding) || !(rotation.determinant() > 0)) {
    camera.fail("rotation", "expected a rotation: a Rodrigues vector, or the rows of its matrix");
  }
  return {Eigen::Quaterniond(rotation).normalized().toRotationMatrix(), translation};
}

RigCamera read_camera(const TomlTable& camera, const std::string& name) {
  if (camera.boolean_or("fisheye", false)) {
    camera.fail("fisheye", "fisheye lenses are not supported; calibrate with the pinhole model");
  }
  return {name,
          CameraModel(read_size(camera), read_matrix(camera), read_distortion(camera),
                      read_cam_from_world(camera)),
          read_colour(camera)};
}

RigCamera read_named_camera(const TomlTable& camera) {
  const std::string name = camera.text("name");
  if (!is_camera_name(name)) {
    camera.fail("name",
                "'" + name + "' is not a valid camera name: " + std::string(kCameraNameRule));
  }
  return read_camera(camera, name);
}

void add(RigCamera camera, const TomlTable& table, Rig& rig) {
  if (find_camera(rig, camera.name) >= 0) {
    const std::string message = "two cameras are named '" + camera.name + "'";
    if (table.has("name")) table.fail("name", message);
    table.fail_here(message);
  }
  rig.push_back(std::move(camera));
}

/// Reads caliscope's [cameras.N] tables.
void read_camera_array(const TomlTable& cameras, Rig& rig) {
  for (const auto& [number, camera] : cameras.sub_tables()) {
    const std::string name = "cam_" + number;
    if (!is_camera_name(name)) {
      camera.fail_here("'" + name +
                       "' is not a valid camera name: " + std::string(kCameraNameRule));
    }
    if (!camera.boolean_or("ignore", false)) add(read_camera(camera, name), camera, rig);
  }
}

std::vector<std::vector<double>> rows_of(const Eigen::Matrix3d& matrix) {
  std::vector<std::vector<double>> rows;
  for (const auto& row : matrix.rowwise()) rows.emplace_back(row.begin(), row.end());
  return rows;
}

std::span<const double> span_of(const Eigen::Vector3d& v) { return {v.data(), 3}; }

void write_camera(const RigCamera& camera, TomlWriter& file) {
  const CameraModel& m = camera.model;
  const std::array<int64_t, 2> size{m.size().width, m.size().height};
  // Other programs read the first five.
  const int used = std::max(5, used_distortions(m.distortion()));
  file.text("name", camera.name)
      .integers("size", size)
      .rows("matrix", rows_of(m.matrix()))
      .numbers("distortions", std::span(m.distortion()).first(used))
      .numbers("rotation", span_of(m.cam_from_world().rodrigues()))
      .numbers("translation", span_of(m.cam_from_world().translation))
      .boolean("fisheye", false);
  if (camera.colour.is_identity()) return;
  file.numbers("colour_black", span_of(camera.colour.black))
      .rows("colour_matrix", rows_of(camera.colour.matrix));
}

}  // namespace

Rig parse_calib(std::string_view text, const std::filesystem::path& path) {
  const TomlTable file = TomlTable::parse(text, path);
  Rig rig;
  for (const auto& [key, camera] : file.sub_tables()) {
    if (!key.starts_with("cam") && !camera.has("matrix")) {
      continue;  // [metadata] and other tables of calibration tools
    }
    if (key == "cameras" && !camera.has("matrix") && !camera.has("name")) {
      read_camera_array(camera, rig);
      continue;
    }
    add(read_named_camera(camera), camera, rig);
  }
  if (rig.empty()) {
    throw InputError(path.string() + ": no camera: expected one [cam_*] table per camera");
  }
  return rig;
}

Rig load_calib(const std::filesystem::path& path) {
  return parse_calib(io::value_or_throw(io::read_file(path, kMaxTakeTextBytes)), path);
}

std::string calib_text(const Rig& rig) {
  TomlWriter file;
  file.comment("metres, z up; x_cam = R x_world + t; rotation = Rodrigues vector of R");
  for (size_t i = 0; i < rig.size(); ++i) {
    write_camera(rig[i], file.table("cam_" + std::to_string(i)));
  }
  return file.written();
}

void save_calib(const std::filesystem::path& path, const Rig& rig) {
  replace_file(path, calib_text(rig));
}

}  // namespace v3d
