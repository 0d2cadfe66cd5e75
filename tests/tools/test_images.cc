#include "tools/test_images.h"

#include <cmath>
#include <numbers>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/videoio.hpp>

#include "base/image/image_files.h"

namespace v3d::test {
namespace {

constexpr double kBallRadius = 0.3;

bool sees_ball(const RigCamera& camera, int x, int y) {
  const Eigen::Vector3d center = camera.model.center();
  const auto ray = camera.model.ray({x, y});
  return ray && (center - ray->dot(center) * *ray).norm() < kBallRadius;
}

Image draw_ball(const RigCamera& camera, Rgb8 colour) {
  Image image(camera.model.size(), PixelFormat::kRGB8);
  for (int y = 0; y < image.size.height; ++y) {
    for (int x = 0; x < image.size.width; ++x) {
      if (!sees_ball(camera, x, y)) continue;
      uint8_t* pixel = image.row(y) + 3 * x;
      pixel[0] = colour.r, pixel[1] = colour.g, pixel[2] = colour.b;
    }
  }
  return image;
}

}  // namespace

Rig small_rig(int cameras) {
  Eigen::Matrix3d matrix;
  matrix << 80, 0, 31.5, 0, 80, 23.5, 0, 0, 1;
  Rig rig;
  for (int i = 0; i < cameras; ++i) {
    const double angle = 2 * std::numbers::pi * i / cameras;
    const Eigen::Vector3d eye(2 * std::cos(angle), 2 * std::sin(angle), 0.5 * (i % 2));
    rig.push_back({std::string(1, static_cast<char>('a' + i)),
                   CameraModel({64, 48}, matrix, {}, look_at(eye, Eigen::Vector3d::Zero()))});
  }
  return rig;
}

Image ball_image(const RigCamera& camera) { return draw_ball(camera, {200, 120, 40}); }
Image ball_mask(const RigCamera& camera) { return draw_ball(camera, {255, 255, 255}); }

void write_video(const std::filesystem::path& path, ImageSize size, int frames, double rate_hz) {
  cv::VideoWriter video(path.string(), cv::CAP_FFMPEG, cv::VideoWriter::fourcc('M', 'J', 'P', 'G'),
                        rate_hz, {size.width, size.height});
  for (int i = 0; i < frames; ++i) {
    const double grey = 40 + 5 * i;
    video.write(cv::Mat(size.height, size.width, CV_8UC3, cv::Scalar(grey, grey, grey)));
  }
}

void write_pictures(const std::filesystem::path& folder, const Rig& rig,
                    Image (*draw)(const RigCamera&)) {
  std::filesystem::create_directories(folder);
  for (const RigCamera& camera : rig) {
    write_png(folder / (camera.name + ".png"), draw(camera).view());
  }
}

void write_jpeg(const std::filesystem::path& path, const Image& rgb) {
  cv::imwrite(path.string(), cv::Mat(rgb.size.height, rgb.size.width, CV_8UC3,
                                     const_cast<uint8_t*>(rgb.bytes.data())));
}

void truncate_file(const std::filesystem::path& path, double keep) {
  const auto size = static_cast<double>(std::filesystem::file_size(path));
  std::filesystem::resize_file(path, static_cast<uintmax_t>(keep * size));
}

}  // namespace v3d::test
