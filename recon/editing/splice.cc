#include "recon/editing/splice.h"

#include <tbb/parallel_for.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "base/core/error.h"
#include "base/core/statistics.h"
#include "recon/metrics/nearest_triangle.h"

namespace v3d::recon {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;
using Eigen::Vector3f;

constexpr double kSameSurfaceM = 0.08;  ///< farther surfaces do not approach each other

/// The motion along the floor and about the vertical axis that brings windows of `b` to those of
/// `a` in the least squares sense.
Isometry3d placed(const Clip& a, size_t first_a, const Clip& b, size_t first_b, size_t count) {
  Vector3d mean_a = Vector3d::Zero(), mean_b = Vector3d::Zero();
  double across = 0, along = 0;
  const auto points = static_cast<double>(count * kBodyJoints);
  for (size_t k = 0; k < count; ++k) {
    for (size_t j = 0; j < kBodyJoints; ++j) {
      const Vector3d& p = a.frames[first_a + k].skeleton.joints[j];
      const Vector3d& q = b.frames[first_b + k].skeleton.joints[j];
      mean_a += p / points;
      mean_b += q / points;
      along += p.x() * q.x() + p.y() * q.y();
      across += p.y() * q.x() - p.x() * q.y();
    }
  }
  along -= points * (mean_a.x() * mean_b.x() + mean_a.y() * mean_b.y());
  across -= points * (mean_a.y() * mean_b.x() - mean_a.x() * mean_b.y());
  Isometry3d motion = Isometry3d::Identity();
  motion.linear() =
      Eigen::AngleAxisd(std::atan2(across, along), Vector3d::UnitZ()).toRotationMatrix();
  mean_a.z() = mean_b.z() = 0;
  motion.translation() = mean_a - motion.linear() * mean_b;
  return motion;
}

double cost(const Clip& a, size_t first_a, const Clip& b, size_t first_b, size_t count) {
  const Isometry3d motion = placed(a, first_a, b, first_b, count);
  double sum = 0;
  for (size_t k = 0; k < count; ++k) {
    for (size_t j = 0; j < kBodyJoints; ++j) {
      const Vector3d& p = a.frames[first_a + k].skeleton.joints[j];
      sum += (p - motion * b.frames[first_b + k].skeleton.joints[j]).squaredNorm();
    }
  }
  return std::sqrt(sum / static_cast<double>(count * kBodyJoints));
}

void move(const Isometry3d& motion, SkeletonPulse& skeleton) {
  for (Vector3d& joint : skeleton.joints) joint = motion * joint;
  for (Eigen::Matrix3d& rotation : skeleton.rotations) rotation = motion.linear() * rotation;
}

void move(const Isometry3d& motion, ClipFrame& frame) {
  for (Vector3f& position : frame.positions)
    position = (motion * position.cast<double>()).cast<float>();
  move(motion, frame.skeleton);
}

Mesh mesh_of(const Clip& clip, const ClipFrame& frame) {
  Mesh mesh;
  mesh.vertices = frame.positions;
  mesh.triangles = clip.surfaces[frame.surface].triangles;
  return mesh;
}

/// Moves the surface of a frame towards that of another one in the same pose.
void approach(const Clip& clip, ClipFrame& frame, const ClipFrame& other, double share) {
  const Mesh mesh = mesh_of(clip, other);
  const NearestTriangle surface(mesh);
  tbb::parallel_for(size_t{0}, frame.positions.size(), [&](size_t v) {
    const auto nearest = surface.find(frame.positions[v].cast<double>());
    if (!nearest || nearest->distance > kSameSurfaceM) return;
    Vector3f position = Vector3f::Zero();
    for (size_t k = 0; k < 3; ++k) {
      position += static_cast<float>(nearest->weights[static_cast<int>(k)]) *
                  mesh.vertices[mesh.triangles[nearest->triangle][k]];
    }
    frame.positions[v] += static_cast<float>(share) * (position - frame.positions[v]);
  });
}

/// Median path of the vertices from a frame to the next one, metres.
double step(const Clip& clip, size_t frame) {
  const ClipFrame& now = clip.frames[frame];
  const ClipFrame& next = clip.frames[frame + 1];
  std::vector<double> metres;
  if (now.surface == next.surface) {
    for (size_t v = 0; v < now.positions.size(); ++v) {
      metres.push_back((next.positions[v] - now.positions[v]).norm());
    }
    return median(metres);
  }
  ClipFrame moved = now;
  pose(clip, moved, next.skeleton);
  const Mesh mesh = mesh_of(clip, next);
  const NearestTriangle surface(mesh);
  for (size_t v = 0; v < now.positions.size(); ++v) {
    const double remaining = surface.find(moved.positions[v].cast<double>())->distance;
    metres.push_back((moved.positions[v] - now.positions[v]).norm() + remaining);
  }
  return median(metres);
}

}  // namespace

SpliceTransition best_transition(const Clip& a, ClipRange at, const Clip& b, ClipRange from,
                                 size_t blend, const std::function<void()>& on_frame) {
  V3D_CHECK(blend >= 1 && a.frames.size() > blend + 1 && b.frames.size() > blend + 1);
  SpliceTransition best{
      .at = 0, .from = 0, .blend = blend, .cost_m = std::numeric_limits<double>::infinity()};
  const size_t last_at = std::min(at.last, a.frames.size() - blend);
  const size_t last_from = std::min(from.last, b.frames.size() - blend);
  for (size_t i = std::min(at.first, last_at - 1); i < last_at; ++i) {
    on_frame();
    for (size_t k = std::min(from.first, last_from - 1); k < last_from; ++k) {
      const double metres = cost(a, i + 1, b, k, blend);
      if (metres < best.cost_m) best = {i, k, blend, metres};
    }
  }
  return best;
}

size_t splice(Clip& a, Clip b, const SpliceTransition& transition) {
  const auto [at, from, blend, cost_m] = transition;
  V3D_CHECK(at + blend < a.frames.size() && from + blend <= b.frames.size());
  const Isometry3d motion = placed(a, at + 1, b, from, blend);
  const size_t surfaces = a.surfaces.size();
  for (ClipFrame& frame : b.frames) {
    move(motion, frame);
    frame.surface += surfaces;
  }
  for (ClipSurface& surface : b.surfaces) {
    move(motion, surface.skin.rest);
    a.surfaces.push_back(std::move(surface));
  }
  size_t last = at;
  for (size_t k = 0; k < blend; ++k) {
    ClipFrame& old = a.frames[at + 1 + k];
    ClipFrame& added = b.frames[from + k];
    const double share = smooth_step(static_cast<double>(k + 1) / static_cast<double>(blend + 1));
    const SkeletonPulse skeleton = blended(old.skeleton, added.skeleton, share);
    pose(a, old, skeleton);
    pose(a, added, skeleton);
    if (share < 0.5) {
      last = at + 1 + k;
    } else {
      std::swap(old, added);
    }
    // Both surfaces are half way to each other where one replaces the other.
    approach(a, old, added, std::min(share, 1 - share));
  }
  a.frames.resize(at + 1 + blend);
  a.frames.insert(
      a.frames.end(),
      std::make_move_iterator(b.frames.begin() + static_cast<std::ptrdiff_t>(from + blend)),
      std::make_move_iterator(b.frames.end()));
  return last;
}

double relative_jump(const Clip& clip, size_t last, size_t around) {
  V3D_CHECK(last + 1 < clip.frames.size());
  std::vector<double> steps;
  const size_t first = last > around ? last - around : 0;
  const size_t end = std::min(last + around + 1, clip.frames.size() - 1);
  for (size_t f = first; f < end; ++f) {
    if (f != last) steps.push_back(step(clip, f));
  }
  const double usual = steps.empty() ? 0 : median(steps);
  return usual > 0 ? step(clip, last) / usual : std::numeric_limits<double>::infinity();
}

}  // namespace v3d::recon
