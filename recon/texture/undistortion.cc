#include "recon/texture/undistortion.h"

#include <algorithm>
#include <cmath>

#include "base/core/error.h"
#include "recon/texture/texture.h"

namespace v3d::recon {
namespace {

/// The smallest size whose middle, (size - 1) / 2, is the principal point `c` of an image that
/// holds the pixels 0 to `size` - 1.
double centred_size(int size, double c) {
  const double half = std::max(c + 0.5, size - 0.5 - c);
  return std::ceil(2 * half - 1e-9);
}

/// Calls draw(x, y, pixel of `camera`) for each pixel of `pinhole` that `camera` sees.
template <class Draw>
void for_each_pixel(const CameraModel& camera, const CameraModel& pinhole, const Draw& draw) {
  const Eigen::Matrix3d& k = pinhole.matrix();
  for (int y = 0; y < pinhole.size().height; ++y) {
    for (int x = 0; x < pinhole.size().width; ++x) {
      const Eigen::Vector2d straight((x - k(0, 2)) / k(0, 0), (y - k(1, 2)) / k(1, 1));
      if (!(straight.squaredNorm() <= camera.max_radius2())) continue;
      const Eigen::Vector2d pixel =
          (camera.matrix() * camera.distort(straight).homogeneous()).head<2>();
      if (camera.inside_image(pixel)) draw(x, y, pixel);
    }
  }
}

}  // namespace

CameraModel pinhole_of(const CameraModel& camera, const std::string& name) {
  const Eigen::Matrix3d& k = camera.matrix();
  const double width = centred_size(camera.size().width, k(0, 2));
  const double height = centred_size(camera.size().height, k(1, 2));
  if (!(std::max(width, height) <= kMaxImageSide)) {
    throw InputError(name + ": its principal point is too far from the image: an undistorted one " +
                     "would have more than " + std::to_string(kMaxImageSide) + " pixels a side");
  }
  Eigen::Matrix3d matrix = Eigen::Matrix3d::Identity();
  matrix(0, 0) = k(0, 0);
  matrix(1, 1) = k(1, 1);
  matrix(0, 2) = (width - 1) / 2;
  matrix(1, 2) = (height - 1) / 2;
  return {{static_cast<int>(width), static_cast<int>(height)}, matrix, {}, camera.cam_from_world()};
}

MaskedImage undistorted(const MaskedImage& source, const CameraModel& camera,
                        const CameraModel& pinhole) {
  MaskedImage result{Image(pinhole.size(), PixelFormat::kRGB8), Mask(pinhole.size())};
  for_each_pixel(camera, pinhole, [&](int x, int y, const Eigen::Vector2d& pixel) {
    const auto u = static_cast<int>(std::floor(pixel.x() + 0.5));
    const auto v = static_cast<int>(std::floor(pixel.y() + 0.5));
    if (source.mask.get(u, v)) result.mask.set(x, y);
    const auto colour = sample_colour(source.image.view(), pixel.x(), pixel.y());
    if (!colour) return;
    uint8_t* const rgb = result.image.row(y) + static_cast<size_t>(3) * x;
    for (int channel = 0; channel < 3; ++channel) {
      rgb[channel] = static_cast<uint8_t>(std::lround((*colour)[channel]));
    }
  });
  return result;
}

std::optional<Eigen::Vector2d> undistorted_pixel(const Eigen::Vector3d& world,
                                                 const CameraModel& camera,
                                                 const CameraModel& pinhole) {
  const auto distorted = camera.project(world);
  const auto ray = distorted ? camera.ray(*distorted) : std::nullopt;
  if (!ray) return std::nullopt;
  const auto pixel = pinhole.project(camera.center() + *ray);
  return pixel && pinhole.inside_image(*pixel) ? pixel : std::nullopt;
}

}  // namespace v3d::recon
