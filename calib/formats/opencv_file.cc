#include "calib/formats/opencv_file.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <initializer_list>
#include <opencv2/core.hpp>
#include <vector>

#include "base/core/error.h"
#include "base/core/text.h"
#include "calib/formats/rig_text.h"

namespace v3d::calib {
namespace {

using Numbers = std::vector<double>;
using Keys = std::initializer_list<const char*>;

constexpr Keys kMatrixKeys = {"camera_matrix", "cameraMatrix", "CameraMatrix", "K"};
constexpr Keys kDistortionKeys = {"distortion_coefficients",
                                  "distCoeffs",
                                  "DistortionCoeffs",
                                  "dist_coeffs",
                                  "dist_coeff",
                                  "dist_coefs",
                                  "distortion",
                                  "dist",
                                  "D"};
constexpr Keys kRotationKeys = {"R", "rvec", "Rotation"};
constexpr Keys kTranslationKeys = {"T", "t", "tvec", "Translation"};
constexpr Keys kSizeKeys = {"image_size", "imageSize", "resolution"};

/// OpenCV's reader is recursive and does not limit the depth.
bool is_too_deep(std::string_view text) {
  constexpr int kMaxLevels = 60;
  int level = 0, blanks = 0;
  for (size_t i = 0; i < text.size(); ++i) {
    const char next = i + 1 < text.size() ? text[i + 1] : '\0';
    const bool opens = text[i] == '<' && next != '/' && next != '?' && next != '!';
    const bool closes = text[i] == '<' && next == '/';
    level += text[i] == '[' || text[i] == '{' || opens;
    level -= text[i] == ']' || text[i] == '}' || closes;
    blanks = text[i] == ' ' ? blanks + 1 : 0;
    if (level > kMaxLevels || blanks > 4 * kMaxLevels) return true;
  }
  return false;
}

/// An open file with checked access. Errors are InputError with the path.
class File {
 public:
  File(std::string_view text, std::filesystem::path path) : path_(std::move(path)) {
    constexpr size_t kMaxBytes = 8 << 20;
    if (text.size() > kMaxBytes || is_too_deep(text)) fail("not a camera calibration");
    try {
      storage_.open(std::string(text), cv::FileStorage::READ | cv::FileStorage::MEMORY);
    } catch (const cv::Exception& error) {
      fail("not an XML, YAML or JSON file of OpenCV: " + printable(error.err));
    }
    if (!storage_.isOpened()) fail("not an XML, YAML or JSON file of OpenCV");
  }

  /// The node of the first key that exists; else an empty node.
  cv::FileNode find(Keys keys) const {
    for (const char* key : keys) {
      if (const cv::FileNode node = storage_[key]; !node.empty()) return node;
    }
    return {};
  }
  /// All numbers of find(); empty where there is no node.
  Numbers numbers(Keys keys) const {
    Numbers result;
    collect(find(keys), result);
    if (!std::ranges::all_of(result, [](double n) { return std::isfinite(n); })) {
      fail(std::string(*keys.begin()) + ": expected finite numbers");
    }
    return result;
  }
  Numbers numbers(Keys keys, size_t count) const {
    Numbers result = numbers(keys);
    if (result.size() != count) {
      fail(std::string(*keys.begin()) + ": expected " + std::to_string(count) + " numbers, found " +
           std::to_string(result.size()));
    }
    return result;
  }
  [[noreturn]] void fail(const std::string& message) const {
    throw InputError(path_.string() + ": " + message);
  }

 private:
  /// Adds the numbers of a number, a nested sequence or a matrix.
  static void collect(const cv::FileNode& node, Numbers& result) {
    constexpr size_t kEnough = 64;  // more than any expected matrix has
    if (result.size() >= kEnough) return;
    if (node.isInt() || node.isReal()) {
      result.push_back(node.real());
    } else if (node.isMap()) {
      if (const cv::FileNode data = node["data"]; data.isSeq()) collect(data, result);
    } else if (node.isSeq()) {
      for (const cv::FileNode& element : node) collect(element, result);
    }
  }

  std::filesystem::path path_;
  cv::FileStorage storage_;
};

void reject_fisheye(const File& file) {
  const cv::FileNode flag = file.find({"fisheye_model", "fisheye"});
  const cv::FileNode model = file.find({"distortion_model", "camera_model"});
  const bool flagged = (flag.isInt() || flag.isReal()) && flag.real() != 0;
  const bool named =
      model.isString() && (model.string() == "fisheye" || model.string() == "equidistant");
  if (flagged || named) {
    file.fail("fisheye lenses are not supported; calibrate with the pinhole model");
  }
}

ImageSize size_of(const File& file, const OpencvDefaults& defaults) {
  Numbers size = file.numbers(kSizeKeys);
  if (size.empty()) {
    size = file.numbers({"image_width", "imageWidth"});
    const Numbers height = file.numbers({"image_height", "imageHeight"});
    size.insert(size.end(), height.begin(), height.end());
  }
  if (size.empty() && defaults.size) return *defaults.size;
  if (size.empty()) file.fail("does not contain the image size; use --size WIDTHxHEIGHT");
  const auto whole = [](double n) { return n >= 1 && n <= kMaxImageSide && n == std::floor(n); };
  if (size.size() != 2 || !whole(size[0]) || !whole(size[1])) {
    file.fail("image_width and image_height: expected 1 to " + std::to_string(kMaxImageSide));
  }
  return {static_cast<int>(size[0]), static_cast<int>(size[1])};
}

Eigen::Matrix3d matrix_of(const Numbers& numbers) {
  return Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(numbers.data());
}

Distortion distortion_of(const File& file, Keys keys) {
  if (file.find(keys).empty()) {
    file.fail("does not contain " + std::string(*keys.begin()) +
              "; for a lens without distortion, give it 5 zeros");
  }
  const Numbers given = file.numbers(keys);
  constexpr std::array<size_t, 6> kLengths = {0, 4, 5, 8, 12, 14};
  if (std::ranges::find(kLengths, given.size()) == kLengths.end()) {
    file.fail(std::string(*keys.begin()) + ": expected 0, 4, 5, 8, 12 or 14 numbers, found " +
              std::to_string(given.size()));
  }
  Distortion distortion{};
  std::ranges::copy(given, distortion.begin());
  return distortion;
}

Eigen::Matrix3d rotation_of(const File& file) {
  const Numbers given = file.numbers(kRotationKeys);
  if (given.size() == 3) {
    constexpr double kMaxRadians = 1e3;
    const Eigen::Vector3d vector(given[0], given[1], given[2]);
    if (!(vector.cwiseAbs().maxCoeff() < kMaxRadians)) file.fail("R: expected radians");
    return RigidTransform::from_rodrigues(vector, Eigen::Vector3d::Zero()).rotation;
  }
  if (given.size() != 9) {
    file.fail("R: expected 3 numbers (Rodrigues) or 9 (matrix), found " +
              std::to_string(given.size()));
  }
  const auto rotation = as_rotation(matrix_of(given));
  if (!rotation) file.fail("R: not a rotation matrix");
  return *rotation;
}

/// The identity where the file contains no pose.
RigidTransform pose_of(const File& file) {
  const bool turned = !file.numbers(kRotationKeys).empty();
  if (!turned && file.numbers(kTranslationKeys).empty()) return {};
  const Numbers t = file.numbers(kTranslationKeys, 3);
  return {rotation_of(file), {t[0], t[1], t[2]}};
}

CameraModel lens_of(const File& file, ImageSize size, Keys matrix, Keys distortion,
                    const RigidTransform& pose) {
  const Eigen::Matrix3d k = matrix_of(file.numbers(matrix, 9));
  if (!is_camera_matrix(k)) {
    file.fail(std::string(*matrix.begin()) + ": " + std::string(kCameraMatrixRule));
  }
  return {size, k, distortion_of(file, distortion), pose};
}

std::string name_of(const File& file, const OpencvDefaults& defaults) {
  const cv::FileNode node = file.find({"name"});
  const std::string name = node.isString() ? node.string() : defaults.name;
  if (!is_camera_name(name)) {
    file.fail("'" + printable(name) +
              "' is not a valid camera name: " + std::string(kCameraNameRule));
  }
  return name;
}

cv::Mat to_mat(const Eigen::Ref<const Eigen::MatrixXd>& from) {
  cv::Mat mat(static_cast<int>(from.rows()), static_cast<int>(from.cols()), CV_64F);
  for (int i = 0; i < mat.rows; ++i) {
    for (int j = 0; j < mat.cols; ++j) mat.at<double>(i, j) = from(i, j);
  }
  return mat;
}

}  // namespace

Rig parse_opencv(std::string_view text, const OpencvDefaults& defaults,
                 const std::filesystem::path& path) {
  const File file(text, path);
  reject_fisheye(file);
  const std::string name = name_of(file, defaults);
  const ImageSize size = size_of(file, defaults);
  const RigidTransform pose = pose_of(file);
  if (file.find({"M1"}).empty()) {
    return {{name, lens_of(file, size, kMatrixKeys, kDistortionKeys, pose)}};
  }
  return {{name + "_1", lens_of(file, size, {"M1"}, {"D1"}, {})},
          {name + "_2", lens_of(file, size, {"M2"}, {"D2"}, pose)}};
}

std::string opencv_text(const RigCamera& camera, OpencvFormat format) {
  const CameraModel& m = camera.model;
  if (m.matrix()(0, 1) != 0) {
    throw InputError(camera.name + ": its lens has skew, which OpenCV does not support; use toml");
  }
  const int used = std::max(4, used_distortions(m.distortion()));
  cv::FileStorage storage(format == OpencvFormat::kXml ? ".xml" : ".yml",
                          cv::FileStorage::WRITE | cv::FileStorage::MEMORY);
  storage << "name" << camera.name << "image_width" << m.size().width << "image_height"
          << m.size().height << "camera_matrix" << to_mat(m.matrix()) << "distortion_coefficients"
          << to_mat(Eigen::Map<const Eigen::VectorXd>(m.distortion().data(), used)) << "R"
          << to_mat(m.cam_from_world().rotation) << "T" << to_mat(m.cam_from_world().translation);
  return storage.releaseAndGetString();
}

}  // namespace v3d::calib
