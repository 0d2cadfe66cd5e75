#include "calib/formats/foreign_rig.h"

#include <Eigen/SVD>
#include <algorithm>
#include <array>
#include <set>

#include "base/core/error.h"
#include "base/core/name.h"
#include "base/core/printable.h"
#include "calib/rig/rig_comparison.h"

namespace v3d::calib {
namespace {

using Names = std::vector<std::string>;

bool all_differ(const Names& names) {
  return std::set<std::string>(names.begin(), names.end()).size() == names.size();
}

/// The axes of the new world (z up) in the old one, for an upward axis of the old one.
Eigen::Matrix3d new_from_old(std::string_view up) {
  struct Turn {
    std::string_view up;
    Eigen::Matrix3d rows;
  };
  const auto rows = [](const Eigen::Vector3d& x, const Eigen::Vector3d& y,
                       const Eigen::Vector3d& z) {
    Eigen::Matrix3d m;
    m << x.transpose(), y.transpose(), z.transpose();
    return m;
  };
  const Eigen::Vector3d x = Eigen::Vector3d::UnitX(), y = Eigen::Vector3d::UnitY(),
                        z = Eigen::Vector3d::UnitZ();
  const std::array<Turn, 6> turns = {{{"z", rows(x, y, z)},
                                      {"-z", rows(x, -y, -z)},
                                      {"y", rows(x, -z, y)},
                                      {"-y", rows(x, z, -y)},
                                      {"x", rows(-z, y, x)},
                                      {"-x", rows(z, y, -x)}}};
  const auto turn = std::ranges::find(turns, up, &Turn::up);
  if (turn == turns.end()) {
    throw InputError("up '" + printable(up) + "': expected x, y, z, -x, -y or -z");
  }
  return turn->rows;
}

}  // namespace

std::optional<Eigen::Matrix3d> as_rotation(const Eigen::Matrix3d& matrix) {
  constexpr double kRounding = 1e-3;
  const Eigen::Matrix3d off = matrix * matrix.transpose() - Eigen::Matrix3d::Identity();
  if (!(off.cwiseAbs().maxCoeff() < kRounding) || !(matrix.determinant() > 0)) return std::nullopt;
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(matrix, Eigen::ComputeFullU | Eigen::ComputeFullV);
  return svd.matrixU() * svd.matrixV().transpose();
}

bool is_camera_matrix(const Eigen::Matrix3d& matrix) {
  return matrix(0, 0) > 0 && matrix(1, 1) > 0 && matrix(1, 0) == 0 &&
         matrix.row(2) == Eigen::RowVector3d(0, 0, 1);
}

bool is_image_size(int64_t width, int64_t height) {
  return width > 0 && height > 0 && width <= kMaxImageSide && height <= kMaxImageSide;
}

Names camera_names(const std::vector<std::filesystem::path>& files,
                   const std::filesystem::path& where) {
  Names stems, folders;
  for (const std::filesystem::path& file : files) {
    stems.push_back(file.stem().string());
    folders.push_back(file.parent_path().filename().string());
  }
  const Names& names = all_differ(stems) ? stems : folders;
  if (!all_differ(names)) {
    throw InputError(
        where.string() +
        ": several images of one camera: neither file names nor folder names distinguish the "
        "cameras");
  }
  for (const std::string& name : names) {
    if (is_file_name(name)) continue;
    throw InputError(where.string() + ": '" + printable(name) +
                     "' is not a valid camera name: " + std::string(kFileNameRule));
  }
  return names;
}

Rig metric_rig(const Rig& rig, double unit_m, std::string_view up) {
  return transformed_rig(rig, {unit_m, {new_from_old(up), Eigen::Vector3d::Zero()}});
}

}  // namespace v3d::calib
