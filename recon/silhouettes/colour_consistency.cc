#include "recon/silhouettes/colour_consistency.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

#include "recon/texture/texture.h"
#include "recon/visibility/depth_buffer.h"

namespace v3d {
namespace {

/// Number of neighbours: the cameras with the most similar viewing directions.
constexpr size_t kNeighbours = 4;
constexpr double kSameSide = 0.2;  ///< smallest cosine between viewing directions
/// Factor by which depth buffers are smaller than the image.
constexpr int kReduction = 4;
constexpr double kToleranceVoxels = 3;
/// Largest difference of equal colours, grey values. The surface is accurate to some voxels only,
/// so means of patches are compared instead of pixels.
constexpr float kSameColour = 24;
constexpr int kPatch = 2;
constexpr int kStep = 3;
/// Smallest number of comparable places.
constexpr int kMinPlaces = 12;
/// Part of the places that agree by chance where the camera sees past the surface. The mean is
/// 0.02; one in 40 pieces has more than this (v3d-silhouette-faults, seeds 401 to 405 and 411 to
/// 415).
constexpr double kByChance = 0.2;
/// Required excess over chance, in standard deviations of independent places. None of these 659
/// pieces exceeds 3.
constexpr double kDeviations = 3.5;

struct View {
  const RigCamera* camera = nullptr;
  const Frame* frame = nullptr;
  DepthBuffer depth;  ///< reduced
};

/// Mean of a patch of the image in the rig's common colour response, regardless of the mask; empty
/// where the frame has no pixels.
std::optional<Eigen::Vector3f> patch_colour(const RigCamera& camera, const Frame& frame,
                                            const Eigen::Vector2d& pixel) {
  Eigen::Vector3f sum = Eigen::Vector3f::Zero();
  for (int dy = -kPatch; dy <= kPatch; dy += kPatch) {
    for (int dx = -kPatch; dx <= kPatch; dx += kPatch) {
      const auto colour = sample_colour(frame.image.view(), pixel.x() + dx - frame.roi.x0,
                                        pixel.y() + dy - frame.roi.y0);
      if (!colour) return {};
      sum += *colour;
    }
  }
  return camera.colour.corrected((sum / 9).cast<double>()).cast<float>();
}

std::vector<View> neighbours_of(const Rig& rig, std::span<const Frame* const> frames, size_t camera,
                                const Mesh& surface) {
  const Eigen::Vector3d direction = rig[camera].model.viewing_direction();
  std::vector<std::pair<double, size_t>> near;
  for (size_t c = 0; c < rig.size(); ++c) {
    const double cosine = direction.dot(rig[c].model.viewing_direction());
    if (c != camera && frames[c] != nullptr && cosine > kSameSide) near.emplace_back(-cosine, c);
  }
  std::ranges::sort(near);
  std::vector<View> views;
  for (size_t n = 0; n < std::min(near.size(), kNeighbours); ++n) {
    const size_t c = near[n].second;
    views.push_back({&rig[c], frames[c], draw_depth(surface, rig[c].model.reduced(kReduction))});
  }
  return views;
}

/// Colour of a place in a view; empty where the place is hidden.
std::optional<Eigen::Vector3f> colour_at(const View& view, const Eigen::Vector3d& place,
                                         double tolerance_m) {
  const CameraModel& model = view.camera->model;
  const auto pixel = model.project(place);
  if (!pixel || !model.inside_image(*pixel)) return {};
  const double z = (model.cam_from_world() * place).z();
  const int x =
      std::min(static_cast<int>((pixel->x() + 0.5) / kReduction), view.depth.size.width - 1);
  const int y =
      std::min(static_cast<int>((pixel->y() + 0.5) / kReduction), view.depth.size.height - 1);
  if (z > view.depth.at(x, y) + tolerance_m) return {};
  return patch_colour(*view.camera, *view.frame, *pixel);
}

bool same(const Eigen::Vector3f& a, const Eigen::Vector3f& b) {
  return (a - b).cwiseAbs().maxCoeff() <= kSameColour;
}

/// True when the majority of the views, and at least two, agree with the camera; empty when fewer
/// than two see the place.
std::optional<bool> agrees(const Eigen::Vector3f& own, std::span<const View> views,
                           const Eigen::Vector3d& place, double tolerance_m) {
  int seen = 0;
  int agreeing = 0;
  for (const View& view : views) {
    const auto colour = colour_at(view, place, tolerance_m);
    if (!colour) continue;
    ++seen;
    agreeing += same(own, *colour);
  }
  if (seen < 2) return {};
  return 2 * agreeing > seen && agreeing >= 2;
}

}  // namespace

class ColourConsistency::Views {
 public:
  Views(const Rig& rig, std::span<const Frame* const> frames, size_t camera, const Mesh& surface,
        double tolerance_m)
      : own_{&rig[camera], frames[camera],
             draw_depth(surface, rig[camera].model.reduced(kReduction))},
        others_(neighbours_of(rig, frames, camera, surface)),
        tolerance_m_(tolerance_m) {}

  /// Agreement at the place of the surface in this pixel; empty where it cannot be determined.
  std::optional<bool> agrees(int x, int y) const {
    const CameraModel& model = own_.camera->model;
    const Eigen::Vector2d pixel(x, y);
    const float z = own_.depth.at(std::min(x / kReduction, own_.depth.size.width - 1),
                                  std::min(y / kReduction, own_.depth.size.height - 1));
    if (!std::isfinite(z)) return {};
    const auto ray = model.ray(pixel);
    const auto colour = patch_colour(*own_.camera, *own_.frame, pixel);
    if (!ray || !colour) return {};
    const double along = z / model.viewing_direction().dot(*ray);
    return v3d::agrees(*colour, others_, model.center() + along * *ray, tolerance_m_);
  }

 private:
  const View own_;
  const std::vector<View> others_;
  const double tolerance_m_;
};

ColourConsistency::ColourConsistency(const Rig& rig, std::span<const Frame* const> frames,
                                     size_t camera, const Mesh& surface, double voxel_m) {
  if (frames[camera] == nullptr) return;
  views_ = std::make_unique<const Views>(rig, frames, camera, surface, kToleranceVoxels * voxel_m);
}

ColourConsistency::~ColourConsistency() = default;

ColourAgreement ColourConsistency::within(const Mask& piece) const {
  ColourAgreement agreement;
  if (!views_) return agreement;
  const Rect box = piece.bounding_box();
  for (int y = box.y0; y < box.y0 + box.height; y += kStep) {
    for (int x = box.x0; x < box.x0 + box.width; x += kStep) {
      if (!piece.get(x, y)) continue;
      const auto result = views_->agrees(x, y);
      agreement.compared += result.has_value();
      agreement.agreeing += result.value_or(false);
    }
  }
  return agreement;
}

bool ColourAgreement::is_consistent() const {
  const double by_chance = kByChance * compared;
  return compared >= kMinPlaces &&
         agreeing > by_chance + kDeviations * std::sqrt(by_chance * (1 - kByChance));
}

}  // namespace v3d
