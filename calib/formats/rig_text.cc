#include "calib/formats/rig_text.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <set>
#include <span>

#include "base/core/error.h"
#include "base/core/text.h"
#include "base/geometry/rigid_transform.h"
#include "calib/formats/text_fields.h"
#include "calib/rig/rig_alignment.h"

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
  return nearest_rotation(matrix);
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
    if (is_camera_name(name)) continue;
    throw InputError(where.string() + ": '" + printable(name) +
                     "' is not a valid camera name: " + std::string(kCameraNameRule));
  }
  return names;
}

Rig metric_rig(const Rig& rig, double unit_m, std::string_view up) {
  return transformed_rig(rig, {unit_m, {new_from_old(up), Eigen::Vector3d::Zero()}});
}

namespace {

constexpr double kHalfPixel = 0.5;  // COLMAP's pixel coordinates minus ours

/// The parameters of a lens model: focal lengths, principal point, distortion coefficients.
struct LensKind {
  std::string_view name;
  int focals;
  int distortions;
};
constexpr std::array<LensKind, 6> kLensKinds = {{{"SIMPLE_PINHOLE", 1, 0},
                                                 {"PINHOLE", 2, 0},
                                                 {"SIMPLE_RADIAL", 1, 1},
                                                 {"RADIAL", 1, 2},
                                                 {"OPENCV", 2, 4},
                                                 {"FULL_OPENCV", 2, 8}}};

using Lenses = std::map<int64_t, CameraModel>;

const LensKind& kind_of(TextLine& line) {
  const std::string_view name = line.word("MODEL");
  const auto* kind = std::ranges::find(kLensKinds, name, &LensKind::name);
  if (kind == kLensKinds.end()) {
    line.fail("lens model " + printable(name) +
              " is not supported; expected SIMPLE_PINHOLE, PINHOLE, SIMPLE_RADIAL, RADIAL, OPENCV "
              "or FULL_OPENCV");
  }
  return *kind;
}

CameraModel parse_lens(TextLine& line) {
  const LensKind& kind = kind_of(line);
  const int64_t width = line.whole("WIDTH"), height = line.whole("HEIGHT");
  if (!is_image_size(width, height)) {
    line.fail("WIDTH and HEIGHT: expected 1 to " + std::to_string(kMaxImageSide));
  }
  Eigen::Matrix3d k = Eigen::Matrix3d::Identity();
  k(0, 0) = line.real("focal length");
  k(1, 1) = kind.focals == 2 ? line.real("focal length") : k(0, 0);
  k(0, 2) = line.real("principal point") - kHalfPixel;
  k(1, 2) = line.real("principal point") - kHalfPixel;
  Distortion distortion{};
  for (int i = 0; i < kind.distortions; ++i) distortion[i] = line.real("distortion");
  if (!is_camera_matrix(k)) line.fail("focal length: expected a positive number");
  if (!line.done()) line.fail("too many parameters for a lens model " + std::string(kind.name));
  return {{static_cast<int>(width), static_cast<int>(height)}, k, distortion, {}};
}

Lenses parse_lenses(std::string_view text, const std::filesystem::path& path) {
  Lenses lenses;
  for (TextLine& line : split_lines(text, path)) {
    if (line.done() || line.is_comment()) continue;
    const int64_t id = line.whole("CAMERA_ID");
    if (!lenses.emplace(id, parse_lens(line)).second) {
      line.fail("duplicate CAMERA_ID " + std::to_string(id));
    }
  }
  return lenses;
}

Eigen::Matrix3d parse_rotation(TextLine& line) {
  constexpr double kRounding = 1e-3;
  const double w = line.real("QW"), x = line.real("QX"), y = line.real("QY"), z = line.real("QZ");
  const Eigen::Quaterniond q(w, x, y, z);
  if (!(std::abs(q.norm() - 1) < kRounding)) {
    line.fail("QW QX QY QZ: expected a quaternion of length 1");
  }
  return q.normalized().toRotationMatrix();
}

struct PosedImage {
  std::filesystem::path file;
  CameraModel model;
};

PosedImage parse_image(TextLine& line, const Lenses& lenses) {
  line.whole("IMAGE_ID");
  const Eigen::Matrix3d rotation = parse_rotation(line);
  const Eigen::Vector3d translation = line.vector("TX TY TZ");
  const int64_t id = line.whole("CAMERA_ID");
  const auto lens = lenses.find(id);
  if (lens == lenses.end()) line.fail("cameras.txt has no camera " + std::to_string(id));
  const CameraModel& m = lens->second;
  return {line.remaining("NAME"),
          CameraModel(m.size(), m.matrix(), m.distortion(), {rotation, translation})};
}

/// Checks the line after an image: its points, three numbers each; possibly empty.
void require_points(const TextLine& line) {
  if (line.count_words() % 3 == 0 && !line.is_comment()) return;
  line.fail(
      "expected the points of the image in the previous line, X Y POINT3D_ID each, or an empty "
      "line");
}

std::vector<PosedImage> parse_images(std::string_view text, const Lenses& lenses,
                                     const std::filesystem::path& path) {
  std::vector<PosedImage> images;
  bool points_are_next = false;
  for (TextLine& line : split_lines(text, path)) {
    if (points_are_next) {
      require_points(line);
      points_are_next = false;
    } else if (!line.done() && !line.is_comment()) {
      images.push_back(parse_image(line, lenses));
      points_are_next = true;
    }
  }
  return images;
}

void require_colmap_lens(const std::string& name, const CameraModel& model) {
  const char* what = model.matrix()(0, 1) != 0                  ? "skew"
                     : used_distortions(model.distortion()) > 8 ? "a thin prism or a tilted sensor"
                                                                : nullptr;
  if (what == nullptr) return;
  throw InputError(name + ": its lens has " + what +
                   ", which no COLMAP model supports; use toml, or calibrate with 8 coefficients");
}

std::string lens_text(const CameraModel& model) {
  const Eigen::Matrix3d& k = model.matrix();
  const int used = used_distortions(model.distortion());
  const int kept = used <= 4 ? used : 8;
  const char* kind = kept == 0 ? "PINHOLE" : kept == 4 ? "OPENCV" : "FULL_OPENCV";
  const Eigen::Vector4d lens(k(0, 0), k(1, 1), k(0, 2) + kHalfPixel, k(1, 2) + kHalfPixel);
  return std::string(kind) + " " + std::to_string(model.size().width) + " " +
         std::to_string(model.size().height) + numbers_text(lens) +
         numbers_text(Eigen::Map<const Eigen::VectorXd>(model.distortion().data(), kept));
}

std::string pose_text(const RigidTransform& pose) {
  const Eigen::Quaterniond q(pose.rotation);
  return numbers_text(Eigen::Vector4d(q.w(), q.x(), q.y(), q.z())) + numbers_text(pose.translation);
}

}  // namespace

Rig parse_colmap(const ColmapText& text, const std::filesystem::path& folder) {
  const Lenses lenses = parse_lenses(text.cameras, folder / "cameras.txt");
  const std::vector<PosedImage> images = parse_images(text.images, lenses, folder / "images.txt");
  if (images.empty()) throw InputError((folder / "images.txt").string() + ": contains no image");
  std::vector<std::filesystem::path> files;
  for (const PosedImage& image : images) files.push_back(image.file);
  const std::vector<std::string> names = camera_names(files, folder / "images.txt");
  Rig rig;
  for (size_t i = 0; i < images.size(); ++i) rig.push_back({names[i], images[i].model});
  return rig;
}

ColmapText colmap_text(const Rig& rig) {
  ColmapText text;
  text.cameras = "# CAMERA_ID MODEL WIDTH HEIGHT PARAMS[]\n";
  text.images =
      "# IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME\n# POINTS2D[] as X Y POINT3D_ID: none\n";
  for (size_t i = 0; i < rig.size(); ++i) {
    const std::string& name = rig[i].name;
    const CameraModel& model = rig[i].model;
    require_colmap_lens(name, model);
    const std::string id = std::to_string(i + 1);
    text.cameras += id + " " + lens_text(model) + "\n";
    text.images += id + pose_text(model.cam_from_world()) + " " + id + " " + name + ".png\n\n";
  }
  return text;
}

namespace {

struct Camera {
  std::filesystem::path image;
  CameraModel model;
};

Camera parse_camera(TextLine& line, ImageSize size) {
  const std::string_view image = line.word("name of the image");
  const Eigen::Matrix3d k = line.matrix("K");
  const auto r = as_rotation(line.matrix("R"));
  const Eigen::Vector3d t = line.vector("t");
  if (!is_camera_matrix(k)) line.fail("K: " + std::string(kCameraMatrixRule));
  if (!r) line.fail("R: not a rotation matrix");
  if (!line.done()) line.fail("expected 22 words: name, K, R and t");
  return {image, CameraModel(size, k, {}, {*r, t})};
}

std::string row_by_row(const Eigen::Matrix3d& m) { return numbers_text(m.transpose().reshaped()); }

}  // namespace

Rig parse_middlebury(std::string_view text, ImageSize size, const std::filesystem::path& path) {
  std::vector<TextLine> lines = split_lines(text, path);
  std::erase_if(lines, [](const TextLine& line) { return line.done(); });
  if (lines.empty()) throw InputError(path.string() + ": empty; expected the number of images");
  const int64_t announced = lines[0].whole("number of images");
  if (announced < 1 || announced != std::ssize(lines) - 1) {
    lines[0].fail("expected " + std::to_string(announced) + " images, found " +
                  std::to_string(lines.size() - 1) + " lines");
  }
  Rig rig;
  std::vector<std::filesystem::path> images;
  for (size_t i = 1; i < lines.size(); ++i) {
    Camera camera = parse_camera(lines[i], size);
    images.push_back(std::move(camera.image));
    rig.push_back({"", std::move(camera.model)});
  }
  const std::vector<std::string> names = camera_names(images, path);
  for (size_t i = 0; i < rig.size(); ++i) rig[i].name = names[i];
  return rig;
}

std::string middlebury_text(const Rig& rig) {
  std::string text = std::to_string(rig.size()) + "\n";
  for (const RigCamera& camera : rig) {
    const CameraModel& model = camera.model;
    if (model.has_distortion()) {
      throw InputError(camera.name +
                       ": its lens has distortion, which Middlebury's _par.txt does not support; "
                       "use colmap, opencv or toml");
    }
    const RigidTransform& pose = model.cam_from_world();
    text += camera.name + ".png" + row_by_row(model.matrix()) + row_by_row(pose.rotation) +
            numbers_text(pose.translation) + "\n";
  }
  return text;
}

}  // namespace v3d::calib
