#include "recon/silhouettes/displaced_camera.h"

#include <fmt/core.h>
#include <tbb/parallel_for.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <functional>
#include <numeric>

#include "base/image/mask_operations.h"

namespace v3d::recon {
namespace {

/// Rows on both sides over which the slope of an outline is measured, times the scale.
constexpr int kReach = 4;
/// Distance between measured rows and columns, times the scale.
constexpr int kStep = 3;
/// Suspects: cameras with at min_shift_px this part of the largest shift, and at max_residual this
/// many.
constexpr double kSuspiciousPart = 0.5;
constexpr size_t kMaxSuspects = 4;
/// Number of pulses in which suspects are measured again.
constexpr size_t kPulsesAgain = 12;

/// An outline pixel of a row: the beginning (side -1) or the end (side 1) of foreground.
struct Edge {
  int x = 0;
  int side = 0;
};

std::vector<Edge> edges_of(const Mask& mask, int y) {
  std::vector<Run> runs;
  append_runs(mask.row(y), y, runs);
  std::vector<Edge> edges;
  for (const Run& run : runs) {
    if (run.begin > 0) edges.push_back({run.begin, -1});
    if (run.end < mask.size().width) edges.push_back({run.end, 1});
  }
  return edges;
}

/// The nearest edge of the same side; null where none is within `reach`.
const Edge* nearest(const std::vector<Edge>& edges, const Edge& to, int reach) {
  const Edge* best = nullptr;
  for (const Edge& edge : edges) {
    if (edge.side != to.side || std::abs(edge.x - to.x) > reach) continue;
    if (best == nullptr || std::abs(edge.x - to.x) < std::abs(best->x - to.x)) best = &edge;
  }
  return best;
}

/// Edges within 45 degrees of vertical, in rows that are multiples of `step`.
std::vector<OutlineOffset> offsets_in_rows(const Mask& hull, const Mask& own, int step, int scale) {
  std::vector<OutlineOffset> offsets;
  const int reach = kReach * scale;
  const Rect box = hull.bounding_box();
  const int first = (box.y0 + reach + step - 1) / step * step;
  for (int y = first; y < box.y0 + box.height - reach; y += step) {
    const auto above = edges_of(hull, y - reach);
    const auto below = edges_of(hull, y + reach);
    const auto ours = edges_of(own, y);
    for (const Edge& edge : edges_of(hull, y)) {
      const Edge* const up = nearest(above, edge, reach);
      const Edge* const down = nearest(below, edge, reach);
      const Edge* const match = nearest(ours, edge, kMaxDisplacementPx * scale);
      if (up == nullptr || down == nullptr || match == nullptr) continue;
      const float slope = static_cast<float>(down->x - up->x) / static_cast<float>(2 * reach);
      const float nx = static_cast<float>(edge.side) / std::sqrt(1 + slope * slope);
      const float aside = static_cast<float>(match->x - edge.x) / static_cast<float>(scale);
      offsets.push_back({nx, -slope * nx, aside * nx});
    }
  }
  return offsets;
}

Mask transposed(const Mask& mask) {
  Mask result({mask.size().height, mask.size().width});
  std::vector<Run> runs;
  for (int y = 0; y < mask.size().height; ++y) append_runs(mask.row(y), y, runs);
  for (const Run& run : runs) {
    for (int x = run.begin; x < run.end; ++x) result.set(run.y, x);
  }
  return result;
}

/// Tukey's biweight. `r` is the residual divided by the cutoff.
double weight(double r) { return std::abs(r) < 1 ? (1 - r * r) * (1 - r * r) : 0; }

/// Model of the offsets: a shift (u, v), and a constant distance, because the hull is wider than
/// the silhouette.
using Explanation = Eigen::Vector3d;

/// One step of iteratively reweighted min_shift_px squares. Offsets with residuals above
/// `max_residual` pixels have weight 0.
Explanation step_of(std::span<const OutlineOffset> offsets, const Explanation& before,
                    double max_residual) {
  Eigen::Matrix3d a = Eigen::Matrix3d::Identity() * 1e-9;
  Eigen::Vector3d b = Eigen::Vector3d::Zero();
  for (const OutlineOffset& o : offsets) {
    const Eigen::Vector3d row(o.nx, o.ny, 1);
    const double w = weight((o.distance - row.dot(before)) / max_residual);
    a += w * row * row.transpose();
    b += w * o.distance * row;
  }
  return a.ldlt().solve(b);
}

/// Robust fit with a decreasing cutoff, which excludes outlines that differ for other reasons.
Eigen::Vector2d shift_of(std::span<const OutlineOffset> offsets) {
  Explanation explanation = Explanation::Zero();
  for (const double max_residual : {16., 8., 8., 5., 5., 4., 4., 4.}) {
    explanation = step_of(offsets, explanation, max_residual);
  }
  return explanation.head<2>();
}

}  // namespace

int displacement_scale(ImageSize size) {
  constexpr int kXgaWidth = 1024;
  return std::max(1, (std::max(size.width, size.height) + kXgaWidth / 2) / kXgaWidth);
}

std::vector<OutlineOffset> outline_offsets(const Mask& hull, const Mask& own, int step) {
  const int scale = displacement_scale(hull.size());
  std::vector<OutlineOffset> offsets = offsets_in_rows(hull, own, step * scale, scale);
  for (OutlineOffset o : offsets_in_rows(transposed(hull), transposed(own), step * scale, scale)) {
    std::swap(o.nx, o.ny);
    offsets.push_back(o);
  }
  return offsets;
}

DisplacementMeter::DisplacementMeter(const Rig& rig) {
  for (const RigCamera& camera : rig) {
    names_.push_back(camera.name);
    sizes_.push_back(camera.model.size());
  }
}

void DisplacementMeter::add(std::span<const Mask* const> masks, std::span<const Mask> hulls) {
  Pulse pulse{std::vector<Offsets>(masks.size()), std::vector<std::vector<uint8_t>>(masks.size())};
  tbb::parallel_for(size_t{0}, masks.size(), [&](size_t c) {
    if (masks[c] == nullptr) return;
    pulse.offsets[c] = outline_offsets(hulls[c], *masks[c], kStep);
    pulse.runs[c] = encode_runs(*masks[c]);
  });
  pulses_.push_back(std::move(pulse));
  if (pulses_.size() > kPulses) pulses_.pop_front();
}

std::vector<CameraDisplacement> DisplacementMeter::shifts() const {
  std::vector<CameraDisplacement> cameras;
  for (size_t c = 0; c < names_.size(); ++c) {
    Offsets all;
    for (const Pulse& pulse : pulses_) {
      all.insert(all.end(), pulse.offsets[c].begin(), pulse.offsets[c].end());
    }
    CameraDisplacement displacement{.camera = names_[c], .outline_px = std::ssize(all)};
    if (displacement.outline_px >= kMinOutlinePx)
      displacement.shift = displacement_scale(sizes_[c]) * shift_of(all);
    cameras.push_back(std::move(displacement));
  }
  return cameras;
}

std::vector<Mask> DisplacementMeter::masks_of(const Pulse& pulse) const {
  std::vector<Mask> masks(names_.size());
  for (size_t c = 0; c < names_.size(); ++c) {
    if (auto mask = decode_runs(pulse.runs[c], sizes_[c])) masks[c] = *std::move(mask);
  }
  return masks;
}

/// The largest shift of `cameras`, pixels, against hulls that exclude `left_out`.
double DisplacementMeter::max_shift_without(size_t left_out, std::span<const size_t> cameras,
                                            LeaveOneOutHull& hulls) const {
  std::vector<Offsets> offsets(names_.size());
  const size_t step = (pulses_.size() + kPulsesAgain - 1) / kPulsesAgain;
  for (size_t p = 0; p < pulses_.size(); p += step) {
    const std::vector<Mask> masks = masks_of(pulses_[p]);
    std::vector<const Mask*> all;
    for (const Mask& mask : masks) all.push_back(mask.size().width > 0 ? &mask : nullptr);
    all[left_out] = nullptr;
    for (const size_t c : cameras) {
      if (c == left_out || all[c] == nullptr) continue;
      const Offsets found = outline_offsets(hulls.silhouette(all, c), masks[c], kStep);
      offsets[c].insert(offsets[c].end(), found.begin(), found.end());
    }
  }
  double max_shift = 0;
  for (const Offsets& all : offsets) {
    if (std::ssize(all) >= kMinOutlinePx) max_shift = std::max(max_shift, shift_of(all).norm());
  }
  return max_shift;
}

size_t DisplacementMeter::find_displaced(std::span<const size_t> suspects,
                                         LeaveOneOutHull& hulls) const {
  std::vector<double> without;
  for (const size_t c : suspects) without.push_back(max_shift_without(c, suspects, hulls));
  return suspects[static_cast<size_t>(std::ranges::min_element(without) - without.begin())];
}

std::vector<CameraDisplacement> DisplacementMeter::result(LeaveOneOutHull& hulls) const {
  std::vector<CameraDisplacement> cameras = shifts();
  const auto px = [&](size_t c) { return cameras[c].shift.norm() / displacement_scale(sizes_[c]); };
  std::vector<size_t> suspects(cameras.size());
  std::iota(suspects.begin(), suspects.end(), size_t{0});
  std::ranges::stable_sort(suspects, std::greater(), px);
  if (suspects.empty() || px(suspects[0]) < kDisplacedPx) return cameras;
  const double min_shift_px = kSuspiciousPart * px(suspects[0]);
  std::erase_if(suspects, [&](size_t c) { return px(c) < min_shift_px; });
  suspects.resize(std::min(suspects.size(), kMaxSuspects));
  const size_t displaced = suspects.size() > 1 ? find_displaced(suspects, hulls) : suspects[0];
  cameras[displaced].displaced = px(displaced) >= kDisplacedPx;
  return cameras;
}

std::string text_of(const CameraDisplacement& camera) {
  return fmt::format(
      "displaced since its calibration: its silhouettes are shifted by {:.1f} pixels ({:+.1f} "
      "right, {:+.1f} down)",
      camera.shift.norm(), camera.shift.x(), camera.shift.y());
}

}  // namespace v3d::recon
