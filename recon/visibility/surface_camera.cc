#include "recon/visibility/surface_camera.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>

#include "recon/render/rasteriser.h"

namespace v3d::recon {
namespace {

constexpr int kMaxHalvings = 8;

}  // namespace

SurfaceCamera::SurfaceCamera(const DeformCamera& camera, int halvings)
    : frame_(camera.frame),
      lens_(camera_of_metres(*camera.model)),
      center_(camera.model->center().cast<float>()) {
  pictures_[0] = Luminance(*frame_, 1 << (halvings + kLevels - 1));
  for (; halvings > 0; --halvings) pictures_[0] = pictures_[0].halved();
  for (int level = 1; level < kLevels; ++level) {
    pictures_[level] = pictures_[level - 1].halved();
  }
}

std::optional<SurfaceCamera::Seen> SurfaceCamera::project(const Eigen::Vector3f& position) const {
  const auto p = camera_point<float>(lens_, position.x(), position.y(), position.z());
  if (p.z < static_cast<float>(kNearPlaneMetres)) return std::nullopt;
  const PixelPoint<float> pixel = pixel_point(lens_, p);
  if (!(pixel.radius2 <= lens_.max_radius2)) return std::nullopt;
  return Seen{{pixel.u, pixel.v}, p.z};
}

bool SurfaceCamera::sees(const Seen& seen, const DepthBuffer& depth, float tolerance_m) const {
  return in_silhouette(seen.pixel) &&
         seen.z <= depth.at(static_cast<int>(seen.pixel.x()), static_cast<int>(seen.pixel.y())) +
                       tolerance_m;
}

SurfaceCameras::SurfaceCameras(std::span<const DeformCamera> given, const Mesh& mesh,
                               double voxel_m) {
  std::vector<const DeformCamera*> with_pixels;
  for (const DeformCamera& camera : given) {
    if (!camera.frame->roi.empty()) with_pixels.push_back(&camera);
  }
  const Eigen::Vector3f middle = vertex_centroid(mesh);
  std::vector<std::optional<SurfaceCamera>> made(with_pixels.size());
  tbb::parallel_for(size_t{0}, made.size(), [&](size_t c) {
    made[c].emplace(*with_pixels[c], redundant_halvings(*with_pixels[c]->model, middle, voxel_m));
  });
  for (size_t c = 0; c < made.size(); ++c) {
    cameras.push_back(std::move(*made[c]));
    models.push_back(*with_pixels[c]->model);
  }
}

int redundant_halvings(const CameraModel& camera, const Eigen::Vector3f& position, double voxel_m) {
  const double z = (camera.cam_from_world() * position.cast<double>()).z();
  const double pixel_m = z / camera.matrix()(0, 0);
  if (!(pixel_m > 0)) return 0;
  // Clamped before the conversion: an empty surface has edges of 0 m, and the logarithm is
  // infinite.
  const double halvings = std::ceil(std::log2(voxel_m / 4 / pixel_m));
  return static_cast<int>(std::clamp(halvings, 0.0, double{kMaxHalvings}));
}

Eigen::Vector3f vertex_centroid(const Mesh& mesh) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3f& vertex : mesh.vertices) sum += vertex.cast<double>();
  if (!mesh.vertices.empty()) sum /= static_cast<double>(mesh.vertices.size());
  return sum.cast<float>();
}

namespace {

/// Index mirrored at the borders (... 2 1 0 1 2 ...), which keeps the pattern of a Bayer mosaic.
int mirrored(int i, int count) {
  const int once = i < 0 ? -i : i;
  return std::clamp(once < count ? once : 2 * (count - 1) - once, 0, count - 1);
}

/// Sums of neighbouring pixels of a row with the weights 1 2 1, at most 1020.
void blur_row(const uint8_t* row, int width, uint16_t* sums) {
  const auto at = [&](int x) { return row[mirrored(x, width)]; };
  const auto sum = [&](int x) { return static_cast<uint16_t>(at(x - 1) + 2 * at(x) + at(x + 1)); };
  sums[0] = sum(0);
  for (int x = 1; x + 1 < width; ++x) {
    sums[x] = static_cast<uint16_t>(row[x - 1] + 2 * row[x] + row[x + 1]);
  }
  sums[width - 1] = sum(width - 1);
}

std::vector<uint8_t> from_bayer(const Image& image) {
  const int width = image.size.width, height = image.size.height;
  std::vector<uint16_t> sums(static_cast<size_t>(width) * height);
  for (int y = 0; y < height; ++y) {
    blur_row(image.row(y), width, sums.data() + static_cast<size_t>(y) * width);
  }
  std::vector<uint8_t> out(sums.size());
  for (int y = 0; y < height; ++y) {
    const auto row = [&](int i) {
      return sums.data() + static_cast<size_t>(mirrored(i, height)) * width;
    };
    const uint16_t *above = row(y - 1), *middle = row(y), *below = row(y + 1);
    uint8_t* to = out.data() + static_cast<size_t>(y) * width;
    for (int x = 0; x < width; ++x) {
      to[x] = static_cast<uint8_t>((above[x] + 2 * middle[x] + below[x] + 8) >> 4);
    }
  }
  return out;
}

std::vector<uint8_t> brightness_of(const Image& image) {
  if (is_bayer(image.format)) return from_bayer(image);
  if (image.format == PixelFormat::kMono8) return image.bytes;
  std::vector<uint8_t> out(static_cast<size_t>(image.size.pixels()));
  for (size_t i = 0; i < out.size(); ++i) {
    const uint8_t* rgb = &image.bytes[3 * i];
    out[i] = static_cast<uint8_t>((rgb[0] + 2 * rgb[1] + rgb[2] + 2) >> 2);
  }
  return out;
}

/// The rows of `inner`, of the size of the roi, with columns and rows before them that repeat the
/// first ones.
std::vector<uint8_t> extended(std::vector<uint8_t> inner, const Rect& roi, int left, int above) {
  if (left == 0 && above == 0) return inner;
  std::vector<uint8_t> rows;
  rows.reserve(static_cast<size_t>(roi.width + left) * static_cast<size_t>(roi.height + above));
  for (int y = -above; y < roi.height; ++y) {
    const uint8_t* row = inner.data() + static_cast<ptrdiff_t>(std::max(y, 0)) * roi.width;
    rows.insert(rows.end(), static_cast<size_t>(left), row[0]);
    rows.insert(rows.end(), row, row + roi.width);
  }
  return rows;
}

}  // namespace

Luminance::Luminance(const Frame& frame, int alignment) {
  const Rect& roi = frame.roi;
  const int left = roi.x0 % alignment, above = roi.y0 % alignment;
  first_u_ = static_cast<float>(roi.x0 - left - kBorder) + 0.5F;
  first_v_ = static_cast<float>(roi.y0 - above - kBorder) + 0.5F;
  put_together(extended(brightness_of(frame.image), roi, left, above), roi.width + left,
               roi.height + above);
}

/// `inner` with its border, in quads.
void Luminance::put_together(const std::vector<uint8_t>& inner, int width, int height) {
  width_ = width + 2 * kBorder;
  height_ = height + 2 * kBorder;
  quads_.resize(static_cast<size_t>(width_) * height_);
  std::vector<uint8_t> rows[2];
  const auto bordered = [&](int y, std::vector<uint8_t>& row) {
    const uint8_t* from =
        inner.data() + static_cast<size_t>(std::clamp(y - kBorder, 0, height - 1)) * width;
    row.assign(kBorder, from[0]);
    row.insert(row.end(), from, from + width);
    row.insert(row.end(), kBorder + 1, from[width - 1]);
  };
  bordered(0, rows[0]);
  for (int y = 0; y < height_; ++y) {
    bordered(y + 1, rows[1]);
    uint32_t* to = quads_.data() + static_cast<size_t>(y) * width_;
    const uint8_t *upper = rows[0].data(), *lower = rows[1].data();
    for (int x = 0; x < width_; ++x) {
      to[x] = upper[x] | uint32_t{upper[x + 1]} << 8 | uint32_t{lower[x]} << 16 |
              uint32_t{lower[x + 1]} << 24;
    }
    rows[0].swap(rows[1]);
  }
}

Luminance Luminance::halved() const {
  Luminance half;
  half.scale_ = scale_ / 2;
  // The border is even: pairs begin at the first pixel of the picture.
  const int width = (width_ - 2 * kBorder) / 2, height = (height_ - 2 * kBorder) / 2;
  std::vector<uint8_t> inner(static_cast<size_t>(std::max(width, 1)) * std::max(height, 1));
  for (int y = 0; y < std::max(height, 1); ++y) {
    for (int x = 0; x < std::max(width, 1); ++x) {
      const uint32_t quad = quads_[static_cast<size_t>(2 * y + kBorder) * width_ + 2 * x + kBorder];
      const uint32_t sum = (quad & 255) + (quad >> 8 & 255) + (quad >> 16 & 255) + (quad >> 24);
      inner[static_cast<size_t>(y) * std::max(width, 1) + x] = static_cast<uint8_t>((sum + 2) / 4);
    }
  }
  half.first_u_ = (first_u_ - 0.5F + kBorder) / 2 - kBorder + 0.5F;
  half.first_v_ = (first_v_ - 0.5F + kBorder) / 2 - kBorder + 0.5F;
  half.put_together(inner, std::max(width, 1), std::max(height, 1));
  return half;
}

}  // namespace v3d::recon
