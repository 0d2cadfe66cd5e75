#include "plan/action_samples.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <span>

#include "sim/performer/performer.h"
#include "sim/rendering/noise.h"
#include "sim/rendering/scene.h"

namespace v3d::plan {
namespace {

using Eigen::Vector2d;

/// Any position in `space` that is not near its sides.
Vector2d position_in(const Box& space, uint64_t seed) {
  Vector2d position = space.center().head<2>();
  for (int axis = 0; axis < 2; ++axis) {
    const double room = std::max(0.0, 0.5 * space.size()[axis] - kReachM);
    position[axis] += sim::uniform(seed, static_cast<uint64_t>(axis), -room, room);
  }
  return position;
}

/// Performers who act at `position`, turned by `yaw_deg` around it.
std::vector<sim::Performer> cast_at(Cast cast, const Vector2d& position, double yaw_deg) {
  std::vector<sim::Performer> performers = sim::cast_of(cast == Cast::kDuel ? 2 : 1);
  const Eigen::Rotation2Dd turn(yaw_deg * M_PI / 180);
  for (sim::Performer& performer : performers) {
    performer.motion.position = position + turn * performer.motion.position;
    performer.motion.yaw_deg += yaw_deg;
  }
  return performers;
}

void raise(std::vector<sim::Part>& parts, double floor) {
  for (sim::Part& part : parts) {
    for (Eigen::Vector3f& v : part.mesh.vertices) v.z() += static_cast<float>(floor);
  }
}

Box extent_of(const sim::DrawList& list) {
  Eigen::AlignedBox3f box;
  for (const Eigen::Vector3f& v : list.vertices) box.extend(v);
  return {box.min().cast<double>(), box.max().cast<double>()};
}

struct MomentSamples {
  ActionMoment moment;
  std::vector<ActionSample> samples;
};

double area_of(const Mesh& mesh) {
  double area = 0;
  for (const auto& [a, b, c] : mesh.triangles) {
    area += 0.5 *
            (mesh.vertices[b] - mesh.vertices[a]).cross(mesh.vertices[c] - mesh.vertices[a]).norm();
  }
  return area;
}

/// Points of the outer surfaces, evenly by area over all performers.
std::vector<ActionSample> samples_of(std::vector<Mesh> surfaces, uint32_t moment, int count,
                                     uint64_t seed) {
  std::vector<sim::Part> parts;
  double total = 0;
  for (Mesh& surface : surfaces) {
    total += area_of(surface);
    parts.emplace_back().mesh = std::move(surface);
  }
  std::vector<ActionSample> samples;
  for (uint32_t p = 0; p < parts.size(); ++p) {
    const std::vector<sim::Part> one = {parts[p]};
    const auto share = static_cast<size_t>(count * area_of(one[0].mesh) / total + 0.5);
    const sim::SurfacePoints points(one, share, sim::mix(seed) + p);
    const auto positions = points.positions(one), normals = points.normals(one);
    for (size_t i = 0; i < positions.size(); ++i) {
      samples.push_back({positions[i], normals[i], moment, p});
    }
  }
  return samples;
}

MomentSamples sample_moment(const Box& space, const ActionOptions& options, int index) {
  const uint64_t seed = sim::mix(options.seed) + static_cast<uint64_t>(index);
  const double within = index + sim::uniform(seed, 7, 0, 1);
  const double seconds = within / options.moments * sim::kActionPeriodSeconds;
  const double yaw = sim::uniform(seed, 8, 0, 360);
  MomentSamples made;
  std::vector<Mesh> surfaces;
  for (const sim::Performer& performer : cast_at(options.cast, position_in(space, seed), yaw)) {
    std::vector<sim::Part> parts = sim::performer_parts(seconds, options.seed, performer);
    raise(parts, floor_of(space));
    sim::DrawList& alone = made.moment.performer.emplace_back();
    for (const sim::Part& part : parts) {
      append(alone, part);
      append(made.moment.all, part);
    }
    surfaces.push_back(sim::outer_surface(parts, options.seed));
  }
  made.moment.extent = extent_of(made.moment.all);
  made.samples =
      samples_of(std::move(surfaces), static_cast<uint32_t>(index), options.points, seed);
  return made;
}

}  // namespace

double floor_of(const Box& space) {
  return space.min.z() <= 0 && space.max.z() > 0 ? 0 : space.min.z();
}

ActionSamples sample_action(const Box& space, const ActionOptions& options) {
  std::vector<MomentSamples> made(static_cast<size_t>(options.moments));
  tbb::parallel_for(0, options.moments, [&](int i) {
    made[static_cast<size_t>(i)] = sample_moment(space, options, i);
  });
  ActionSamples action;
  for (MomentSamples& moment : made) {
    action.moments.push_back(std::move(moment.moment));
    std::ranges::copy(moment.samples, std::back_inserter(action.samples));
  }
  return action;
}

namespace {

using Eigen::Vector3d;
using Eigen::Vector3f;

constexpr int kRasterSide = 512;       // pixels
constexpr double kToleranceM = 0.012;  // two pixels of the raster at 3 m
constexpr double kMaxHalfAngle = 1.2;  // radians; for a position close to the performer

/// A square view from `eye` that just contains the box.
CameraModel view_of(const Vector3d& eye, const Box& box) {
  const double radius = 0.5 * box.size().norm();
  const double distance = std::max(1e-3, (box.center() - eye).norm());
  const double half_angle = std::min(kMaxHalfAngle, std::asin(std::min(1.0, radius / distance)));
  Eigen::Matrix3d k = Eigen::Matrix3d::Identity();
  k(0, 0) = k(1, 1) = 0.5 * kRasterSide / std::tan(half_angle);
  k(0, 2) = k(1, 2) = 0.5 * (kRasterSide - 1);
  return {{kRasterSide, kRasterSide}, k, {}, look_at(eye, box.center())};
}

float incidence(const Vector3f& eye, const ActionSample& sample) {
  static const float kMinCosine = static_cast<float>(std::cos(kMaxIncidenceDeg * M_PI / 180));
  const float cosine = (eye - sample.point).normalized().dot(sample.normal);
  return cosine < kMinCosine ? 0 : cosine;
}

/// Clears the incidence of the samples in `range` that surfaces of `list` hide.
void clear_hidden(const CameraModel& view, const sim::DrawList& list,
                  std::span<const ActionSample> samples, std::span<float> incidence) {
  std::vector<Vector3f> points;
  points.reserve(samples.size());
  for (const ActionSample& sample : samples) points.push_back(sample.point);
  const std::vector<uint8_t> seen = sim::points_seen(view, list, points, kToleranceM);
  for (size_t i = 0; i < seen.size(); ++i) {
    if (!seen[i]) incidence[i] = 0;
  }
}

/// End of the samples from `begin` on that `same` holds for.
template <class Same>
size_t end_of_run(const std::vector<ActionSample>& samples, size_t begin, Same same) {
  const auto from = samples.begin() + static_cast<std::ptrdiff_t>(begin);
  return static_cast<size_t>(std::find_if_not(from, samples.end(), same) - samples.begin());
}

}  // namespace

std::vector<float> incidence_from(const Vector3d& eye, const ActionSamples& action,
                                  bool own_performer_only) {
  const std::vector<ActionSample>& samples = action.samples;
  std::vector<float> values(samples.size());
  const Vector3f from = eye.cast<float>();
  std::ranges::transform(samples, values.begin(),
                         [&](const ActionSample& sample) { return incidence(from, sample); });
  for (size_t begin = 0; begin < samples.size();) {
    const ActionSample& first = samples[begin];
    const size_t end = end_of_run(samples, begin, [&](const ActionSample& s) {
      return s.moment == first.moment && (!own_performer_only || s.performer == first.performer);
    });
    const ActionMoment& moment = action.moments[first.moment];
    clear_hidden(view_of(eye, moment.extent),
                 own_performer_only ? moment.performer[first.performer] : moment.all,
                 std::span(samples).subspan(begin, end - begin),
                 std::span(values).subspan(begin, end - begin));
    begin = end;
  }
  return values;
}

bool in_image(const CameraModel& camera, const ActionSample& sample) {
  const auto pixel = camera.project(sample.point.cast<double>());
  return pixel && camera.inside_image(*pixel);
}

}  // namespace v3d::plan
