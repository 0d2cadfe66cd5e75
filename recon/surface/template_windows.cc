#include "recon/surface/template_windows.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "recon/surface/template_windows.cc"
#include <hwy/foreach_target.h>  // compiles this file once per instruction set
#include <hwy/highway.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstring>
#include <span>

HWY_BEFORE_NAMESPACE();
namespace v3d::recon::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

#include "recon/simd_int16.inc"

// Each lane is a depth. No sum crosses lanes, so the number of lanes has no influence.
static_assert(kDepthSteps % kLanes == 0);

HWY_INLINE Lanes lanes_at(const float* from) { return Lanes(hn::Load(Floats(), from)); }
HWY_INLINE void put(Lanes value, float* to) { hn::Store(value.v, Floats(), to); }

// Coordinates are integers in units of 1 / 65,536 pixel.
constexpr float kFixedPointOne = 65536;

// Samples are integers with kSampleOne units per grey value. Two samples share a lane, and the sum
// of all products of the largest window fits in a lane.
constexpr int kSampleShift = 18;
constexpr float kSampleOne = 127.0F * 32767 / (1 << kSampleShift);
constexpr auto kMaxSample = static_cast<int64_t>(255 * kSampleOne);
static_assert(kMaxSample * kMaxSample * kMaxWindowSide * kMaxWindowSide < INT32_MAX);

constexpr int kMaxPairs = (kMaxWindowSide * kMaxWindowSide + 1) / 2;

/// Samples of a window at kLanes depths.
struct Patch {
  alignas(64) int32_t pair[kMaxPairs][kLanes];  ///< two samples; the first is in the low half
  alignas(64) float sum[kLanes];
  alignas(64) float inverse_deviation[kLanes];  ///< 1 / sqrt(sum of squared differences)
};

/// Positions of the samples of a window relative to its centre.
struct Offsets {
  int32_t u[kMaxWindowSide * kMaxWindowSide + 1], v[kMaxWindowSide * kMaxWindowSide + 1];
};

HWY_INLINE int32_t fixed_point(float pixels) {
  return static_cast<int32_t>(kFixedPointOne * pixels);
}
HWY_INLINE IntLanes fixed_point(Lanes pixels) { return truncate(Lanes(kFixedPointOne) * pixels); }

void find_offsets(const WindowView& view, int side, Offsets& offsets) {
  const int32_t u_across = fixed_point(view.u_across), v_across = fixed_point(view.v_across);
  const int32_t u_down = fixed_point(view.u_down), v_down = fixed_point(view.v_down);
  const int half = side / 2;
  int n = 0;
  for (int j = -half; j <= half; ++j) {
    for (int i = -half; i <= half; ++i) {
      offsets.u[n] = i * u_across + j * u_down;
      offsets.v[n++] = i * v_across + j * v_down;
    }
  }
}

/// Interpolates a Luminance at (u, v), times 2^kSampleShift. (u, v) must lie inside the image.
HWY_INLINE IntLanes sample(const int32_t* quads, IntLanes row_length, IntLanes u, IntLanes v) {
  const auto pixel = hn::Or(hn::And(v, all(0xFFFF0000)), hn::ShiftRight<16>(u));
  const auto quad = hn::GatherIndex(Ints(), quads, products_of_halves(pixel, row_length));
  // Interpolate along both rows in units of 1/127, with weights 127 - right and right.
  const auto right = hn::And(hn::ShiftRight<1>(second_byte_everywhere(u)), all(0x7F7F7F7F));
  const auto rows = products_of_bytes(quad, hn::Xor(right, all(0x007F007F)));
  // Interpolate between the rows in units of 1/32,767.
  const auto down = hn::And(hn::ShiftRight<1>(low_half_everywhere(v)), all(0x7FFF7FFF));
  return products_of_halves(rows, hn::Xor(down, all(0x00007FFF)));
}

HWY_INLINE void take(const WindowView& view, int side, float noise, Lanes depth, Patch& patch) {
  const Ints ints;
  Offsets offsets;
  find_offsets(view, side, offsets);
  const auto* quads = reinterpret_cast<const int32_t*>(view.image->quads());
  const auto row_length = hn::Set(ints, view.image->width() << 16 | 1);
  const auto u = fixed_point(Lanes(view.u) + depth * view.u_out);
  const auto v = fixed_point(Lanes(view.v) + depth * view.v_out);
  const auto at = [&](int n) {
    return sample(quads, row_length, hn::Add(u, hn::Set(ints, offsets.u[n])),
                  hn::Add(v, hn::Set(ints, offsets.v[n])));
  };
  auto sum = hn::Zero(ints), squares = hn::Zero(ints);
  const auto keep = [&](int pair, IntLanes both) {
    sum = hn::Add(sum, products_of_halves(both, all(0x00010001)));
    squares = hn::Add(squares, products_of_halves(both, both));
    hn::Store(both, ints, patch.pair[pair]);
  };
  const int samples = side * side;  // an odd number
  for (int n = 0; n + 1 < samples; n += 2) {
    const auto second = hn::And(hn::ShiftRight<kSampleShift - 16>(at(n + 1)), all(0xFFFF0000));
    keep(n / 2, hn::Or(hn::ShiftRight<kSampleShift>(at(n)), second));
  }
  keep(samples / 2, hn::ShiftRight<kSampleShift>(at(samples - 1)));

  const auto count = static_cast<float>(samples);
  const Lanes total(hn::ConvertTo(Floats(), sum));
  const Lanes of_squares(hn::ConvertTo(Floats(), squares));
  const Lanes variance(hn::Max((of_squares - total * total * (1 / count)).v, hn::Zero(Floats())));
  const float unsure = count * noise * kSampleOne * kSampleOne;
  put(total, patch.sum);
  put(Lanes(1.0F) / Lanes(hn::Sqrt((variance + unsure).v)), patch.inverse_deviation);
}

HWY_INLINE Lanes correlation(const Patch& a, const Patch& b, int samples) {
  const Ints ints;
  auto sum = hn::Zero(ints);
  for (int pair = 0; pair < samples / 2 + 1; ++pair) {
    sum = hn::Add(sum,
                  products_of_halves(hn::Load(ints, a.pair[pair]), hn::Load(ints, b.pair[pair])));
  }
  const Lanes mean = lanes_at(a.sum) * lanes_at(b.sum) * (1 / static_cast<float>(samples));
  const Lanes covariance = Lanes(hn::ConvertTo(Floats(), sum)) - mean;
  return covariance * (lanes_at(a.inverse_deviation) * lanes_at(b.inverse_deviation));
}

void correlate_any(const WindowViews& views, const CorrelationOptions& options,
                   DepthProfile& profile) {
  Patch reference, other;
  alignas(64) float steps[kDepthSteps];
  for (int k = 0; k < kDepthSteps; ++k) steps[k] = options.first + static_cast<float>(k);
  const Lanes min_ncc(options.robust ? 0.0F : -1.0F);
  for (size_t k = 0; k < kDepthSteps; k += kLanes) {
    const Lanes depth = lanes_at(steps + k);
    take(views.view[0], options.side, options.noise, depth, reference);
    Lanes sum(0.0F);
    for (int c = 1; c < views.count; ++c) {
      take(views.view[c], options.side, options.noise, depth, other);
      const Lanes ncc = correlation(reference, other, options.side * options.side);
      sum = sum + Lanes(hn::Max(ncc.v, min_ncc.v));
    }
    const Lanes mean = sum * (1 / static_cast<float>(views.count - 1));
    hn::StoreU(mean.v, Floats(), profile.data() + k);
  }
}

HWY_INLINE Lanes higher(Lanes a, Lanes b) { return Lanes(hn::Max(a.v, b.v)); }
HWY_INLINE Lanes lower(Lanes a, Lanes b) { return Lanes(hn::Min(a.v, b.v)); }

/// Scores at kLanes depths.
struct Pairs {
  alignas(64) float score[kLanes];
  /// Largest correlation of each view with another view.
  alignas(64) float best_of[kMaxWindowViews][kLanes];
};

HWY_INLINE void compare_pairs(std::span<const Patch> patches, int samples, Pairs& pairs) {
  for (auto& best : pairs.best_of) put(Lanes(0.0F), best);
  Lanes best(0.0F), second(0.0F);
  for (size_t a = 0; a < patches.size(); ++a) {
    for (size_t b = a + 1; b < patches.size(); ++b) {
      const Lanes ncc = correlation(patches[a], patches[b], samples);
      second = higher(second, lower(best, ncc));
      best = higher(best, ncc);
      for (const size_t c : {a, b}) put(higher(lanes_at(pairs.best_of[c]), ncc), pairs.best_of[c]);
    }
  }
  put(Lanes(0.5F) * (best + second), pairs.score);
}

void correlate_pairs_any(const WindowViews& views, const CorrelationOptions& options,
                         float min_correlation, PairAgreement& agreement) {
  std::array<Patch, kMaxWindowViews> patches;
  Pairs pairs;
  alignas(64) float steps[kDepthSteps];
  for (int k = 0; k < kDepthSteps; ++k) steps[k] = options.first + static_cast<float>(k);
  for (size_t k = 0; k < kDepthSteps; k += kLanes) {
    for (int c = 0; c < views.count; ++c) {
      take(views.view[c], options.side, options.noise, lanes_at(steps + k), patches[c]);
    }
    compare_pairs(std::span(patches).first(views.count), options.side * options.side, pairs);
    for (size_t lane = 0; lane < kLanes; ++lane) {
      uint32_t agreeing = 0;
      for (int c = 0; c < views.count; ++c) {
        agreeing |= static_cast<uint32_t>(pairs.best_of[c][lane] >= min_correlation) << c;
      }
      agreement.score[k + lane] = pairs.score[lane];
      agreement.agreeing[k + lane] = static_cast<uint8_t>(agreeing);
    }
  }
}

}  // namespace
}  // namespace v3d::recon::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace v3d::recon {

HWY_EXPORT(correlate_any);
HWY_EXPORT(correlate_pairs_any);

bool window_fits(const WindowView& view, const CorrelationOptions& options) {
  const int reach = options.side / 2;
  const auto half = static_cast<float>(reach);
  const float last = options.first + kDepthSteps - 1;
  const float u_reach = half * (std::abs(view.u_across) + std::abs(view.u_down));
  const float v_reach = half * (std::abs(view.v_across) + std::abs(view.v_down));
  for (const float depth : {options.first, last}) {
    const float u = view.u + depth * view.u_out, v = view.v + depth * view.v_out;
    // A margin of half a pixel for rounding.
    if (!(u - u_reach > 0.5F && v - v_reach > 0.5F &&
          u + u_reach < static_cast<float>(view.image->width()) - 1.5F &&
          v + v_reach < static_cast<float>(view.image->height()) - 1.5F)) {
      return false;
    }
  }
  return true;
}

void correlate(const WindowViews& views, const CorrelationOptions& options, DepthProfile& profile) {
  HWY_DYNAMIC_DISPATCH(correlate_any)(views, options, profile);
}

void correlate_pairs(const WindowViews& views, const CorrelationOptions& options,
                     float min_correlation, PairAgreement& agreement) {
  HWY_DYNAMIC_DISPATCH(correlate_pairs_any)(views, options, min_correlation, agreement);
}

namespace {

using Eigen::Vector2f;
using Eigen::Vector3f;

/// An arbitrary axis of the window in the tangent plane.
Vector3f axis_across(const Vector3f& normal) {
  const Vector3f other = std::abs(normal.z()) < 0.9F ? Vector3f::UnitZ() : Vector3f::UnitX();
  return normal.cross(other).normalized();
}

bool corners_in_silhouette(const SurfaceCamera& camera, const Vector2f& middle,
                           const Vector2f& across, const Vector2f& down) {
  const Vector2f one = across + down, other = across - down;
  return camera.in_silhouette(middle + one) && camera.in_silhouette(middle - one) &&
         camera.in_silhouette(middle + other) && camera.in_silhouette(middle - other);
}

}  // namespace

void WindowBlock::find(std::span<const Vector3f> positions, std::span<const Vector3f> normals,
                       std::span<const SurfaceCamera> cameras,
                       std::span<const VertexVisibility> visibilities, const WindowOptions& options,
                       const CorrelationOptions& correlation) {
  const int max_views = std::min(options.max_views, kMaxWindowViews);
  for (size_t i = 0; i < positions.size(); ++i) {
    candidates_[i].count = 0;
    if (i % options.every == 0) choose_cameras(i, visibilities, max_views);
  }
  list_observers(normals.first(positions.size()), options, cameras.size());
  for (size_t c = 0; c < cameras.size(); ++c) {
    project_axes(positions, normals, cameras[c], observers_[c], options);
  }
  for (size_t i = 0; i < positions.size(); ++i)
    make_views(i, cameras, visibilities, options, correlation);
}

void WindowBlock::choose_cameras(size_t i, std::span<const VertexVisibility> visibilities,
                                 int max_views) {
  auto& [count, list] = candidates_[i];
  for (uint32_t c = 0; c < visibilities.size(); ++c) {
    const float facing = visibilities[c].seen[i];
    if (facing < 0 || (count == max_views && !(facing > list[count - 1].facing))) continue;
    int k = count < max_views ? count++ : count - 1;
    for (; k > 0 && list[k - 1].facing < facing; --k) list[k] = list[k - 1];
    list[k].facing = facing;
    list[k].camera = c;
  }
}

/// Lists the windows by camera.
void WindowBlock::list_observers(std::span<const Vector3f> normals, const WindowOptions& options,
                                 size_t cameras) {
  observers_.resize(cameras);
  for (std::vector<Observer>& observers : observers_) observers.clear();
  for (size_t i = 0; i < normals.size(); ++i) {
    auto& [count, list] = candidates_[i];
    if (count > 0) across_[i] = options.spacing_m * axis_across(normals[i]);
    for (int k = 0; k < count; ++k) observers_[list[k].camera].push_back({i, &list[k]});
  }
}

/// Projects, for all windows that the camera sees, the ends of one step along each window axis and
/// along the normal.
void WindowBlock::project_axes(std::span<const Vector3f> positions,
                               std::span<const Vector3f> normals, const SurfaceCamera& camera,
                               std::span<const Observer> observers, const WindowOptions& options) {
  PointBlock points;
  PixelBlock pixels;
  static_assert(3 * VertexVisibility::kCapacity <= PointBlock::kCapacity);
  for (const auto& [i, candidate] : observers) {
    points.set(points.count++, positions[i] + across_[i]);
    points.set(points.count++, positions[i] + normals[i].cross(across_[i]));
    points.set(points.count++, positions[i] + options.step_m * normals[i]);
  }
  project_block(camera, points, pixels);
  size_t at = 0;
  const auto next_pixel = [&] {
    const Vector2f pixel(pixels.u[at], pixels.v[at]);
    ++at;
    return pixel;
  };
  for (const auto& [i, candidate] : observers) {
    candidate->across = next_pixel();
    candidate->down = next_pixel();
    candidate->out = next_pixel();
  }
}

void WindowBlock::make_views(size_t i, std::span<const SurfaceCamera> cameras,
                             std::span<const VertexVisibility> visibilities,
                             const WindowOptions& options, const CorrelationOptions& correlation) {
  WindowViews& views = views_[i];
  views.count = 0;
  for (int k = 0; k < candidates_[i].count; ++k) {
    const Candidate& candidate = candidates_[i].list[k];
    const SurfaceCamera& camera = cameras[candidate.camera];
    const Luminance& picture = camera.picture(options.level);
    const Vector2f seen = visibilities[candidate.camera].at(i).pixel,
                   middle = seen * picture.scale();
    const Vector2f a = candidate.across * picture.scale() - middle;
    const Vector2f d = candidate.down * picture.scale() - middle;
    const Vector2f o = candidate.out * picture.scale() - middle;
    const WindowView view{&picture,
                          middle.x() - picture.first_u(),
                          middle.y() - picture.first_v(),
                          a.x(),
                          a.y(),
                          d.x(),
                          d.y(),
                          o.x(),
                          o.y()};
    if (!window_fits(view, correlation)) continue;
    const int samples_to_side = correlation.side / 2;
    const float reach = static_cast<float>(samples_to_side) / picture.scale();
    if (views.count == 0 && !corners_in_silhouette(camera, seen, reach * a, reach * d)) return;
    views.camera[views.count] = candidate.camera;
    views.view[views.count++] = view;
  }
}

}  // namespace v3d::recon
#endif
