#include "recon/render/renderer.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>

#include "base/geometry/rigid_transform.h"
#include "recon/render/rasteriser.h"

namespace v3d::recon {
namespace {

constexpr int kSamples = 2;  // per pixel and axis
constexpr int kBandRows = 32;
constexpr int kNormalPasses = 4;
constexpr double kGreyLight = 0.75;
const Eigen::Vector3f kGrey(206, 203, 198);

CameraModel enlarged(const CameraModel& camera, int factor) {
  Eigen::Matrix3d matrix = camera.matrix();
  matrix.topRows<2>() *= factor;
  matrix(0, 2) = (camera.matrix()(0, 2) + 0.5) * factor - 0.5;
  matrix(1, 2) = (camera.matrix()(1, 2) + 0.5) * factor - 0.5;
  return {{camera.size().width * factor, camera.size().height * factor},
          matrix,
          camera.distortion(),
          camera.cam_from_world()};
}

Eigen::Vector3f vector(Rgb8 c) { return {float(c.r), float(c.g), float(c.b)}; }

/// Vertex normals averaged with those of neighbours. Without averaging, the half-voxel steps of a
/// lattice mesh appear as contour lines.
std::vector<Eigen::Vector3f> smooth_normals(const Mesh& mesh) {
  std::vector<Eigen::Vector3f> normals = vertex_normals(mesh);
  for (int pass = 0; pass < kNormalPasses; ++pass) {
    std::vector<Eigen::Vector3f> sums = normals;
    for (const auto& [a, b, c] : mesh.triangles) {
      const Eigen::Vector3f sum = normals[a] + normals[b] + normals[c];
      sums[a] += sum;
      sums[b] += sum;
      sums[c] += sum;
    }
    std::transform(sums.begin(), sums.end(), normals.begin(),
                   [](const Eigen::Vector3f& n) { return n.normalized(); });
  }
  return normals;
}

/// Brightness of each vertex under a light at the camera.
std::vector<float> vertex_lights(const Mesh& mesh, const Eigen::Vector3d& eye, float head_light) {
  if (head_light <= 0) return std::vector<float>(mesh.vertices.size(), 1);
  const std::vector<Eigen::Vector3f> normals = smooth_normals(mesh);
  std::vector<float> lights(mesh.vertices.size());
  for (size_t v = 0; v < lights.size(); ++v) {
    const Eigen::Vector3f to_eye = (eye.cast<float>() - mesh.vertices[v]).normalized();
    lights[v] = 1 - head_light + head_light * std::max(0.0F, normals[v].dot(to_eye));
  }
  return lights;
}

/// What is interpolated over a triangle, at its corners: the shaded colour, or a position in the
/// atlas and the brightness there.
class CornerValues {
 public:
  CornerValues(const Mesh& mesh, const CameraModel& camera, const DrawOptions& options)
      : mesh_(mesh), atlas_(options.atlas) {
    const bool coloured = atlas_ != nullptr || !mesh.colours.empty();
    lights_ = vertex_lights(mesh, camera.center(),
                            static_cast<float>(coloured ? options.head_light : kGreyLight));
  }

  std::array<Eigen::Vector3f, 3> of(uint32_t t) const {
    std::array<Eigen::Vector3f, 3> values;
    for (size_t k = 0; k < 3; ++k) {
      const uint32_t v = mesh_.triangles[t][k];
      if (atlas_ != nullptr) {
        const Eigen::Vector2f& texel = atlas_->layout.corners[t][k];
        values[k] = {texel.x(), texel.y(), lights_[v]};
      } else {
        values[k] = lights_[v] * (mesh_.colours.empty() ? kGrey : vector(mesh_.colours[v]));
      }
    }
    return values;
  }

 private:
  const Mesh& mesh_;
  const TextureAtlas* atlas_;
  std::vector<float> lights_;
};

/// Values and 1/z of a piece of a triangle. Value / z is linear across the image, the value is not.
struct ShadedTriangle {
  std::array<ScreenVertex, 3> corner;
  ScreenPlane inverse_z;
  std::array<ScreenPlane, 3> value_over_z;
  float row_begin = 0, row_end = 0;

  Eigen::Vector3f value_at(int x, int y, double inverse) const {
    Eigen::Vector3f value;
    for (int c = 0; c < 3; ++c) {
      value[c] = static_cast<float>(value_over_z[static_cast<size_t>(c)](x, y) / inverse);
    }
    return value;
  }
};

ShadedTriangle shade(const ScreenTriangle& piece, const std::array<Eigen::Vector3f, 3>& values) {
  ShadedTriangle shaded;
  shaded.corner = piece.corner;
  std::array<double, 3> inverse{};
  std::array<std::array<double, 3>, 3> channel{};
  for (int k = 0; k < 3; ++k) {
    inverse[k] = piece.corner[k].inverse_z;
    const Eigen::Vector3f value = piece.weights[k].x() * values[0] +
                                  piece.weights[k].y() * values[1] +
                                  piece.weights[k].z() * values[2];
    for (int c = 0; c < 3; ++c) {
      channel[c][k] = value[c] * inverse[k];
    }
  }
  shaded.inverse_z = ScreenPlane(piece.corner, inverse);
  for (int c = 0; c < 3; ++c) {
    shaded.value_over_z[c] = ScreenPlane(piece.corner, channel[c]);
  }
  const auto [low, high] = std::minmax({piece.corner[0].y, piece.corner[1].y, piece.corner[2].y});
  shaded.row_begin = low;
  shaded.row_end = high;
  return shaded;
}

std::vector<ShadedTriangle> shaded_triangles(const Mesh& mesh, const CameraModel& camera,
                                             const DrawOptions& options) {
  const CornerValues values(mesh, camera, options);
  std::vector<ShadedTriangle> triangles;
  triangles.reserve(mesh.triangles.size());
  for_each_screen_triangle(mesh, camera, project_vertices(mesh, camera),
                           [&](uint32_t t, const ScreenTriangle& piece) {
                             triangles.push_back(shade(piece, values.of(t)));
                           });
  return triangles;
}

/// A range of rows of the supersampled image.
class Canvas {
 public:
  Canvas(const CameraModel& camera, const DrawOptions& options, Band band)
      : camera_(camera),
        options_(options),
        band_(band),
        colour_(static_cast<size_t>(band.width) * (band.row_end - band.row_begin)),
        inverse_z_(colour_.size(), 0.0F) {}

  void draw_background(const Floor* floor) {
    const Eigen::Vector3f top = vector(options_.top), bottom = vector(options_.bottom);
    const Eigen::Vector3d eye = camera_.center();
    for (int y = band_.row_begin; y < band_.row_end; ++y) {
      const float down = static_cast<float>(y) / static_cast<float>(camera_.size().height);
      const Eigen::Vector3f plain = top + down * (bottom - top);
      for (int x = 0; x < band_.width; ++x) {
        colour_[at(x, y)] = options_.backdrop == nullptr ? plain : backdrop(x, y);
        if (floor != nullptr) {
          draw_floor(*floor, eye, x, y);
        }
      }
    }
  }

  void draw(const ShadedTriangle& t) {
    if (t.row_end < static_cast<float>(band_.row_begin) ||
        t.row_begin > static_cast<float>(band_.row_end)) {
      return;
    }
    for_each_span(t.corner, band_, [&](int y, int x_begin, int x_end) {
      for (int x = x_begin; x < x_end; ++x) {
        const double inverse = t.inverse_z(x, y);
        if (inverse > inverse_z_[at(x, y)]) {
          inverse_z_[at(x, y)] = static_cast<float>(inverse);
          const Eigen::Vector3f value = t.value_at(x, y, inverse);
          colour_[at(x, y)] = options_.atlas == nullptr
                                  ? value
                                  : Eigen::Vector3f(value.z() * sample_atlas(options_.atlas->image,
                                                                             value.head<2>()));
        }
      }
    });
  }

  /// The mean of kSamples x kSamples samples, for each pixel.
  void resolve_into(Image& image) const {
    for (int y = band_.row_begin / kSamples; y < band_.row_end / kSamples; ++y) {
      for (int x = 0; x < image.size.width; ++x) {
        Eigen::Vector3f sum = Eigen::Vector3f::Zero();
        for (int k = 0; k < kSamples * kSamples; ++k) {
          sum += colour_[at(kSamples * x + k % kSamples, kSamples * y + k / kSamples)]
                     .cwiseMax(0)
                     .cwiseMin(255);
        }
        for (int c = 0; c < 3; ++c) {
          image.row(y)[3 * x + c] = static_cast<uint8_t>(sum[c] / (kSamples * kSamples) + 0.5F);
        }
      }
    }
  }

 private:
  size_t at(int x, int y) const {
    return static_cast<size_t>(y - band_.row_begin) * band_.width + x;
  }

  Eigen::Vector3f backdrop(int x, int y) const {
    const uint8_t* rgb = options_.backdrop->row(y / kSamples) + 3 * (x / kSamples);
    return {float(rgb[0]), float(rgb[1]), float(rgb[2])};
  }

  void draw_floor(const Floor& floor, const Eigen::Vector3d& eye, int x, int y) {
    const auto ray = camera_.ray({x, y});
    const auto hit = ray ? floor.hit(eye, *ray, 1 / camera_.matrix()(0, 0)) : std::nullopt;
    if (hit) {
      Eigen::Vector3f& colour = colour_[at(x, y)];
      colour += hit->light * (Eigen::Vector3f::Constant(255) - colour);
      colour *= 1 - hit->shadow;
      const double z = hit->distance_m * ray->dot(camera_.viewing_direction());
      inverse_z_[at(x, y)] = static_cast<float>(1 / z);
    }
  }

  const CameraModel& camera_;
  const DrawOptions& options_;
  Band band_;
  std::vector<Eigen::Vector3f> colour_;
  std::vector<float> inverse_z_;
};

}  // namespace

Image draw_mesh(const Mesh& mesh, const CameraModel& camera, const DrawOptions& options) {
  const CameraModel large = enlarged(camera, kSamples);
  const std::vector<ShadedTriangle> triangles = shaded_triangles(mesh, large, options);
  const std::optional<Floor> floor =
      options.floor ? std::optional<Floor>(std::in_place, mesh, *options.floor) : std::nullopt;
  Image image(camera.size(), PixelFormat::kRGB8);
  const int rows = large.size().height;
  tbb::parallel_for(0, (rows + kBandRows - 1) / kBandRows, [&](int b) {
    Canvas canvas(large, options,
                  {large.size().width, b * kBandRows, std::min(rows, (b + 1) * kBandRows)});
    canvas.draw_background(floor ? &*floor : nullptr);
    for (const ShadedTriangle& t : triangles) {
      canvas.draw(t);
    }
    canvas.resolve_into(image);
  });
  return image;
}

Mask draw_silhouette(const Mesh& mesh, const CameraModel& camera) {
  Mask mask(camera.size());
  const Band whole{camera.size().width, 0, camera.size().height};
  const auto fill = [&](int y, int x_begin, int x_end) { mask.fill_row(y, x_begin, x_end); };
  for_each_screen_triangle(
      mesh, camera, project_vertices(mesh, camera),
      [&](uint32_t, const ScreenTriangle& t) { for_each_span(t.corner, whole, fill); });
  return mask;
}

std::vector<Mask> draw_silhouettes(const Mesh& mesh, std::span<const CameraModel> cameras) {
  std::vector<Mask> masks(cameras.size());
  tbb::parallel_for(size_t{0}, cameras.size(),
                    [&](size_t i) { masks[i] = draw_silhouette(mesh, cameras[i]); });
  return masks;
}

namespace {

constexpr double kShadowCellMetres = 0.02;  // of a mesh that kMaxShadowCells of these can hold
constexpr int kShadowBlurCells = 4;         // of this size; of larger ones fewer
constexpr int kMaxShadowCells = 1024;
constexpr double kShadowHeightMetres = 0.6;  // height at which the shadow is reduced to 1/e

/// Running mean over 2 r + 1 cells of one line.
void blur_line(std::vector<float>& map, size_t first, size_t step, int count, int r,
               std::vector<float>& scratch) {
  scratch.resize(count);
  for (int i = 0; i < count; ++i) {
    scratch[i] = map[first + i * step];
  }
  float sum = 0;
  for (int i = -r; i < count; ++i) {
    sum += i + r < count ? scratch[i + r] : 0;
    sum -= i - r - 1 >= 0 ? scratch[i - r - 1] : 0;
    if (i >= 0) {
      map[first + i * step] = sum / static_cast<float>(2 * r + 1);
    }
  }
}

/// Share of the pixel that a grid line covers, 0 to 1. `spread`: metres of floor per pixel.
double line_cover(double coordinate, double grid_m, double spread) {
  const double off = std::abs(coordinate - grid_m * std::round(coordinate / grid_m));
  const double cover = std::clamp(1.0 + 0.006 / spread - off / spread, 0.0, 1.0);
  return cover * std::clamp(1.5 - 3 * spread / grid_m, 0.0, 1.0);  // distant lines would flicker
}

}  // namespace

Floor::Floor(const Mesh& mesh, const FloorOptions& options) : options_(options) {
  const Box bounds = bounds_of(mesh);
  middle_ = bounds.center().head<2>();
  radius_m_ = std::max(1.5, bounds.size().norm());
  draw_shadow(mesh);
}

void Floor::draw_shadow(const Mesh& mesh) {
  const Box bounds = bounds_of(mesh);
  if (mesh.triangles.empty() || !bounds.size().allFinite()) {
    return;
  }
  // Cells double, so that their size seldom changes from picture to picture.
  shadow_cell_m_ = kShadowCellMetres;
  int blur_cells = kShadowBlurCells;
  while (bounds.size().head<2>().maxCoeff() > kMaxShadowCells * shadow_cell_m_) {
    shadow_cell_m_ *= 2;
    blur_cells /= 2;
  }
  const int margin_cells = 3 * blur_cells + 1;
  const Eigen::Vector2d cells = bounds.size().head<2>() / shadow_cell_m_;
  shadow_origin_ = bounds.min.head<2>() - Eigen::Vector2d::Constant(margin_cells * shadow_cell_m_);
  shadow_width_ = static_cast<int>(cells.x()) + 2 * margin_cells + 1;
  shadow_height_ = static_cast<int>(cells.y()) + 2 * margin_cells + 1;
  shadow_.assign(static_cast<size_t>(shadow_width_) * shadow_height_, 0.0F);

  for (const auto& triangle : mesh.triangles) {
    std::array<ScreenVertex, 3> corner;
    double height = 0;
    for (int k = 0; k < 3; ++k) {
      const Eigen::Vector3d p = mesh.vertices[triangle[k]].cast<double>();
      const Eigen::Vector2d at = (p.head<2>() - shadow_origin_) / shadow_cell_m_;
      corner[k].x = static_cast<float>(at.x());
      corner[k].y = static_cast<float>(at.y());
      height += std::max(0.0, p.z() - options_.z) / 3;
    }
    const auto dark = static_cast<float>(std::exp(-height / kShadowHeightMetres));
    for_each_span(corner, Band{shadow_width_, 0, shadow_height_}, [&](int y, int begin, int end) {
      for (int x = begin; x < end; ++x) {
        float& cell = shadow_[static_cast<size_t>(y) * shadow_width_ + x];
        cell = std::max(cell, dark);
      }
    });
  }
  std::vector<float> scratch;
  for (int pass = 0; pass < 3; ++pass) {
    for (int y = 0; y < shadow_height_; ++y) {
      blur_line(shadow_, static_cast<size_t>(y) * shadow_width_, 1, shadow_width_, blur_cells,
                scratch);
    }
    for (int x = 0; x < shadow_width_; ++x) {
      blur_line(shadow_, x, shadow_width_, shadow_height_, blur_cells, scratch);
    }
  }
}

float Floor::shadow_at(double x, double y) const {
  const double u = (x - shadow_origin_.x()) / shadow_cell_m_;
  const double v = (y - shadow_origin_.y()) / shadow_cell_m_;
  if (!(u >= 0 && v >= 0 && u < shadow_width_ - 1 && v < shadow_height_ - 1)) {
    return 0;
  }
  const int i = static_cast<int>(u), j = static_cast<int>(v);
  const auto s = static_cast<float>(u - i), t = static_cast<float>(v - j);
  const float* low = shadow_.data() + static_cast<size_t>(j) * shadow_width_ + i;
  const float* high = low + shadow_width_;
  return (low[0] * (1 - s) + low[1] * s) * (1 - t) + (high[0] * (1 - s) + high[1] * s) * t;
}

std::optional<FloorHit> Floor::hit(const Eigen::Vector3d& eye, const Eigen::Vector3d& direction,
                                   double pixel_rad) const {
  if (direction.z() > -1e-4 || eye.z() <= options_.z) {
    return std::nullopt;
  }
  FloorHit hit;
  hit.distance_m = (options_.z - eye.z()) / direction.z();
  const Eigen::Vector3d at = eye + hit.distance_m * direction;
  // Change of x on the floor with the angle of the ray: d (1, 0, -d_x / d_z), which is
  // perpendicular to the ray.
  const auto spread = [&](double d) {
    return hit.distance_m * pixel_rad * std::hypot(1.0, d / direction.z());
  };
  const double lines = std::max(line_cover(at.x(), options_.grid_m, spread(direction.x())),
                                line_cover(at.y(), options_.grid_m, spread(direction.y())));
  const double far = (at.head<2>() - middle_).norm() / radius_m_;
  const double fade = std::exp(-far * far);
  hit.light = static_cast<float>(fade * (0.05 + 0.16 * lines));
  hit.shadow = static_cast<float>(options_.shadow_depth) * shadow_at(at.x(), at.y());
  return hit;
}

}  // namespace v3d::recon
