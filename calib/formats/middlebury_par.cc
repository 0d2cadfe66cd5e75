#include "calib/formats/middlebury_par.h"

#include <algorithm>

#include "base/core/error.h"
#include "calib/formats/foreign_rig.h"
#include "calib/formats/text_fields.h"

namespace v3d::calib {
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
