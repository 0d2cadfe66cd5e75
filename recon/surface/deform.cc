#include "recon/surface/deform.h"

#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_invoke.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <string>

#include "base/core/error.h"
#include "base/image/mask_operations.h"
#include "recon/mesh/mesh_neighbours.h"
#include "recon/mesh/self_intersection.h"
#include "recon/surface/displacement_field.h"
#include "recon/surface/template_windows.h"
#include "recon/visibility/depth_buffer.h"

namespace v3d::recon {
namespace {

using Eigen::Vector3f;

/// Resolution and range of one pass over the surface. Lengths in voxels.
struct DeformPass {
  int level;      ///< of the images
  float spacing;  ///< between samples of the template window
  float step;     ///< between depths
  float first;    ///< steps; negative is inwards, where the surface must lie
  size_t every;   ///< every n-th vertex is correlated; windows of neighbours overlap
  bool outlines;  ///< uses the silhouette force too
};

/// A hull is too large, especially in concavities. The first pass searches 6.6 voxels inwards and
/// 2.4 outwards; the others correct its result. The hull fills its silhouettes, so the first pass
/// does not need them.
constexpr DeformPass kSearchPasses[] = {
    {1, 2.0F, 0.6F, -11, 3, false}, {0, 1.2F, 0.3F, -8, 2, true}, {0, 1.0F, 0.2F, -8, 1, true}};
constexpr DeformPass kPaperPass{0, 1.0F, 0.25F, -8, 1, true};

// Factors of the weights of equation (1) in search mode, chosen by measurement so that the weights
// of the paper give the best result.
constexpr double kSmoothnessOfInternal = 1.0;
constexpr double kWeightOfPhotometric = 2.5;
constexpr double kPullOfSilhouette = 0.05;

/// Smoothing steps before and between the passes, because marching cubes have few normal
/// directions.
constexpr int kSmoothingBefore = 2;
constexpr int kSmoothingAfterPass = 1;
constexpr int kNormalSmoothing = 2;

// Parameters of the paper's mode.
constexpr int kPaperPasses = 12;  ///< at most; each renews visibility and correlation
constexpr int kStepsPerPass = 4;
constexpr float kSmallMotion = 0.02F;  ///< voxels: end when no vertex moves farther

/// Depth tolerance of the visibility test, voxels, without the slant.
constexpr float kHiddenBehind = 0.6F;
/// Variance of image noise, squared grey values.
constexpr float kNoiseVariance = 2;

}  // namespace

void check(const DeformOptions& o) {
  const auto reject = [](const char* field, const std::string& want) {
    throw InputError(std::string("deform: ") + field + ": want " + want);
  };
  for (const auto& [field, weight] : {std::pair{"internal", o.internal},
                                      {"photometric", o.photometric},
                                      {"silhouette", o.silhouette}}) {
    if (!(weight >= 0 && weight <= 1)) reject(field, "a weight from 0 to 1");
  }
  if (o.window < 3 || o.window > kMaxWindowSide || o.window % 2 == 0) {
    reject("window", "an odd number of samples from 3 to " + std::to_string(kMaxWindowSide));
  }
  if (o.views < 2 || o.views > kMaxWindowViews) {
    reject("views", "2 to " + std::to_string(kMaxWindowViews) + " cameras");
  }
}

class Deformer::Impl {
 public:
  explicit Impl(const DeformOptions& options)
      : options_(options), voxel_(static_cast<float>(options.voxel_m)) {}

  void run(const SurfaceCameras& cameras, Mesh& mesh) {
    cameras_ = cameras.cameras;
    models_ = cameras.models;
    if (cameras_.empty() || mesh.vertices.empty()) return;
    neighbours_ = Neighbours(mesh);
    start_ = mesh.vertices;
    if (options_.mode == DeformMode::kPaper) {
      run_paper_mode(mesh);
    } else {
      run_search_mode(mesh);
    }
    remove_self_intersections(neighbours_, start_, options_.lattice, mesh);
  }

 private:
  void run_search_mode(Mesh& mesh) {
    const bool smooth = options_.internal > 0;
    rows_ = NeighbourRows(neighbours_);
    smooth_surface(neighbours_, smooth ? kSmoothingBefore : 0, mesh.vertices, work_);
    for (const DeformPass& pass : kSearchPasses) {
      observe(pass, mesh);
      const std::span<const float> way =
          field_.solve(rows_, profiles_, known_, pulls_,
                       {.first = pass.first,
                        .step_m = pass.step * voxel_,
                        .smoothness = weight(kSmoothnessOfInternal, options_.internal),
                        .photometric = weight(kWeightOfPhotometric, options_.photometric)});
      for_each_vertex(way.size(), [&](size_t v) { mesh.vertices[v] += way[v] * normals_[v]; });
      smooth_surface(neighbours_, smooth ? kSmoothingAfterPass : 0, mesh.vertices, work_);
    }
  }

  void run_paper_mode(Mesh& mesh) {
    for (int i = 0; i < kPaperPasses; ++i) {
      observe(kPaperPass, mesh);
      moved_.assign(mesh.vertices.size(), 0.0F);
      float largest = 0;
      for (int step = 0; step < kStepsPerPass; ++step) largest = move_by_forces(mesh);
      if (largest < kSmallMotion * voxel_) return;
    }
  }

  /// Step 1 of the algorithm, and the correlations and silhouette displacements for steps 2 and 3.
  void observe(const DeformPass& pass, const Mesh& mesh) {
    const size_t count = mesh.vertices.size();
    tbb::parallel_invoke(
        [&] {
          normals_ = vertex_normals(mesh);
          smooth_normals(neighbours_, kNormalSmoothing, normals_, work_);
        },
        [&] { draw_depths(mesh, models_, depths_, Faces::kFront); });
    if (pass.outlines && options_.silhouette > 0) find_outlines();
    profiles_.resize(count);
    known_.assign(count, 0);
    pulls_.assign(count, {});
    constexpr size_t kBlock = VertexVisibility::kCapacity;
    tbb::enumerable_thread_specific<BlockVisibility> of_threads;
    tbb::parallel_for(size_t{0}, (count + kBlock - 1) / kBlock, [&](size_t block) {
      observe_block(pass, mesh, block * kBlock, of_threads.local());
    });
  }

  void observe_block(const DeformPass& pass, const Mesh& mesh, size_t first,
                     BlockVisibility& block) {
    const size_t count = std::min(VertexVisibility::kCapacity, mesh.vertices.size() - first);
    const auto positions = std::span(mesh.vertices).subspan(first, count);
    const auto normals = std::span<const Vector3f>(normals_).subspan(first, count);
    block.compute(positions, normals, cameras_, depths_, {.tolerance_m = kHiddenBehind * voxel_});
    if (options_.photometric > 0) correlate_block(pass, positions, first, block);
    if (pass.outlines && options_.silhouette > 0) pull_block(positions, first, block.by_camera());
  }

  void correlate_block(const DeformPass& pass, std::span<const Vector3f> positions, size_t first,
                       BlockVisibility& block) {
    const CorrelationOptions correlation{.side = options_.window,
                                         .first = pass.first,
                                         .noise = kNoiseVariance,
                                         .robust = options_.mode != DeformMode::kPaper};
    block.windows.find(positions, std::span<const Vector3f>(normals_).subspan(first), cameras_,
                       block.by_camera(),
                       {.level = pass.level,
                        .max_views = options_.views,
                        .every = pass.every,
                        .spacing_m = pass.spacing * voxel_,
                        .step_m = pass.step * voxel_},
                       correlation);
    for (size_t i = 0; i < positions.size(); ++i) {
      const WindowViews& views = block.windows.views(i);
      if (views.count < 2) continue;
      correlate(views, correlation, profiles_[first + i]);
      known_[first + i] = 1;
    }
  }

  void pull_block(std::span<const Vector3f> positions, size_t first,
                  std::span<const VertexVisibility> visibilities) {
    const float each = weight(kPullOfSilhouette, options_.silhouette);
    for (size_t c = 0; c < cameras_.size(); ++c) {
      const VertexBits near =
          grazing_vertices(near_[c], visibilities[c], positions.size(), kMaxOutlineFacing);
      for_each_bit(near, [&](size_t i) {
        const auto way = silhouette_displacement(cameras_[c], depths_[c], positions[i],
                                                 normals_[first + i], visibilities[c].at(i));
        if (!way) return;
        pulls_[first + i].weight += each;
        pulls_[first + i].sum_m += each * *way;
      });
    }
  }

  void find_outlines() {
    near_.resize(cameras_.size());
    tbb::parallel_for(size_t{0}, near_.size(),
                      [&](size_t c) { near_[c] = near_outline(cameras_[c], depths_[c]); });
  }

  /// Equation (1) and step 3 for every vertex. Returns the largest motion, metres.
  float move_by_forces(Mesh& mesh) {
    const size_t count = mesh.vertices.size();
    work_.resize(count);
    for_each_vertex(count, [&](size_t v) { work_[v] = force(mesh, v); });
    float largest2 = 0;
    for (size_t v = 0; v < count; ++v) {
      mesh.vertices[v] += work_[v];
      moved_[v] += work_[v].dot(normals_[v]);
      largest2 = std::max(largest2, work_[v].squaredNorm());
    }
    return std::sqrt(largest2);
  }

  Vector3f force(const Mesh& mesh, size_t v) const {
    const Vector3f internal = internal_force(neighbours_, mesh.vertices, v);
    const float along = static_cast<float>(options_.photometric) * photometric_force(v) +
                        static_cast<float>(options_.silhouette) * silhouette_force(v);
    return static_cast<float>(options_.internal) * internal + along * normals_[v];
  }

  /// Equation (3) along the normal: the gradient of the mean correlation, per voxel, in voxels. The
  /// paper does not say in which units it is added to lengths.
  float photometric_force(size_t v) const {
    if (!known_[v]) return 0;
    const float at = moved_[v] / (kPaperPass.step * voxel_) - kPaperPass.first;
    const int k = std::clamp(static_cast<int>(at + 0.5F), 1, kDepthSteps - 2);
    const float per_step = 0.5F * (profiles_[v][k + 1] - profiles_[v][k - 1]);
    return voxel_ * per_step / kPaperPass.step;
  }

  /// Equation (6): the mean over cameras of the remaining displacements.
  float silhouette_force(size_t v) const {
    return pulls_[v].weight > 0 ? pulls_[v].sum_m / pulls_[v].weight - moved_[v] : 0;
  }

  static float weight(double factor, double option) { return static_cast<float>(factor * option); }

  const DeformOptions options_;
  const float voxel_;
  std::span<const SurfaceCamera> cameras_;  ///< of the current frame
  std::span<const CameraModel> models_;
  std::vector<DepthBuffer> depths_;
  std::vector<Mask> near_;  ///< see near_outline()
  Neighbours neighbours_;
  NeighbourRows rows_;  ///< the same for field_
  std::vector<Vector3f> start_, normals_, work_;
  std::vector<DepthProfile> profiles_;
  std::vector<uint8_t> known_;
  std::vector<OutlinePull> pulls_;
  std::vector<float> moved_;  ///< along the normal since observe(), metres
  DisplacementField field_;
};

Deformer::Deformer(const DeformOptions& options) : impl_(std::make_unique<Impl>(options)) {}
Deformer::~Deformer() = default;
void Deformer::run(const SurfaceCameras& cameras, Mesh& mesh) { impl_->run(cameras, mesh); }

namespace {

using Eigen::Vector2f;

// In pixels of SurfaceCamera::picture(0).
constexpr float kOutlinePixels = 2;  ///< a vertex farther from the mesh's outline is not on it
constexpr float kSearchPixels = 8;   ///< how far the observed outline may be
constexpr float kStepPixels = 0.25F;
constexpr float kProbeMetres = 0.005F;

/// Signed distance from `from` along `direction` to the nearest change of `inside`: outwards from
/// an inner pixel, inwards from an outer one. `direction` has the length of one pixel of
/// picture(0), and so has the unit of the result.
template <class Inside>
std::optional<float> outline_along(const Vector2f& from, const Vector2f& direction, float reach,
                                   const Inside& inside) {
  const bool here = inside(from);
  const float sign = here ? 1.0F : -1.0F;
  for (float t = kStepPixels; t <= reach; t += kStepPixels) {
    if (inside(from + sign * t * direction) != here) return sign * (t - kStepPixels / 2);
  }
  return std::nullopt;
}

bool deep_inside(const Vector2f& pixel, ImageSize size, float room) {
  return pixel.x() >= room && pixel.y() >= room &&
         pixel.x() < static_cast<float>(size.width) - room &&
         pixel.y() < static_cast<float>(size.height) - room;
}

/// Packs eight bytes, each 0 or 1, into the bits of one byte; the first byte becomes the lowest
/// bit.
uint64_t bits_of_bytes(const uint8_t* bytes) {
  uint64_t word = 0;
  std::memcpy(&word, bytes, sizeof word);
  return word * 0x0102'0408'1020'4080 >> 56;  // byte i times 2^(56 - 7 i) is bit 56 + i
}

Mask drawn_pixels(const DepthBuffer& depth) {
  Mask drawn(depth.size);
  std::vector<uint8_t> finite(64 * static_cast<size_t>(drawn.words_per_row()), 0);
  for (int y = 0; y < depth.size.height; ++y) {
    const float* z = depth.z.data() + static_cast<size_t>(y) * depth.size.width;
    for (int x = 0; x < depth.size.width; ++x) finite[x] = std::isfinite(z[x]);
    const std::span<uint64_t> row = drawn.row(y);
    for (size_t byte = 0; byte < finite.size() / 8; ++byte) {
      row[byte / 8] |= bits_of_bytes(&finite[8 * byte]) << (byte % 8 * 8);
    }
  }
  return drawn;
}

}  // namespace

namespace {

/// The pixels at most `pixels` of picture(0) from the outline of `mask`; all where that is too far.
Mask near_outline_of(const SurfaceCamera& camera, const Mask& mask, float pixels) {
  const int radius = static_cast<int>(std::ceil(pixels * camera.coarseness()));
  if (radius <= kMaxRadius) return difference_of(dilate(mask, radius), erode(mask, radius));
  Mask anywhere(mask.size());
  for (int y = 0; y < mask.size().height; ++y) anywhere.fill_row(y, 0, mask.size().width);
  return anywhere;
}

/// A search for outlines along the projected normal.
struct OutlineSearch {
  Vector2f direction;     ///< a pixel of picture(0)
  float metres_of_pixel;  ///< along the normal
};

std::optional<OutlineSearch> search_along(const SurfaceCamera& camera, ImageSize size,
                                          const Eigen::Vector3f& position,
                                          const Eigen::Vector3f& normal,
                                          const SurfaceCamera::Seen& seen) {
  const float room = (kSearchPixels + 1) * camera.coarseness();
  if (!deep_inside(seen.pixel, size, room)) return std::nullopt;
  const auto beside = camera.project(position + kProbeMetres * normal);
  if (!beside) return std::nullopt;
  const Vector2f across = beside->pixel - seen.pixel;
  const float length = across.norm() / camera.coarseness();
  if (!(length > 0)) return std::nullopt;
  return OutlineSearch{across / length, kProbeMetres / length};
}

std::optional<float> observed_outline(const SurfaceCamera& camera, const Vector2f& from,
                                      const Vector2f& direction) {
  return outline_along(from, direction, kSearchPixels,
                       [&](const Vector2f& p) { return camera.in_silhouette(p); });
}

}  // namespace

Mask near_silhouette_outline(const SurfaceCamera& camera) {
  return near_outline_of(camera, camera.silhouette(), kSearchPixels);
}

Mask near_outline(const SurfaceCamera& camera, const DepthBuffer& depth) {
  return near_outline_of(camera, drawn_pixels(depth), kOutlinePixels);
}

std::optional<float> silhouette_displacement(const SurfaceCamera& camera, const DepthBuffer& depth,
                                             const Eigen::Vector3f& position,
                                             const Eigen::Vector3f& normal,
                                             const SurfaceCamera::Seen& seen) {
  const auto search = search_along(camera, depth.size, position, normal, seen);
  if (!search) return std::nullopt;
  const auto drawn = [&](const Vector2f& p) {
    return std::isfinite(depth.at(static_cast<int>(p.x()), static_cast<int>(p.y())));
  };
  const auto drawn_at = outline_along(seen.pixel, search->direction, kOutlinePixels, drawn);
  if (!drawn_at) return std::nullopt;
  const auto observed_at = observed_outline(camera, seen.pixel, search->direction);
  if (!observed_at) return std::nullopt;
  return (*observed_at - *drawn_at) * search->metres_of_pixel;
}

std::optional<float> displacement_to_silhouette(const SurfaceCamera& camera,
                                                const Eigen::Vector3f& position,
                                                const Eigen::Vector3f& normal,
                                                const SurfaceCamera::Seen& seen) {
  const auto search = search_along(camera, camera.silhouette().size(), position, normal, seen);
  if (!search) return std::nullopt;
  const auto observed_at = observed_outline(camera, seen.pixel, search->direction);
  if (!observed_at) return std::nullopt;
  return *observed_at * search->metres_of_pixel;
}

}  // namespace v3d::recon
