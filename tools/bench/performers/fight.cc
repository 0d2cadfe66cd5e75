#include "performers/fight.h"

#include <tbb/parallel_for.h>

#include <ctime>
#include <optional>
#include <utility>

#include "recon/metrics/nearest_triangle.h"
#include "sim/performer/performer.h"
#include "sim/rendering/scene.h"
#include "workload.h"

namespace v3d::bench {
namespace {

constexpr int kPerformers = 2;
const Box kSpace{{-1.5, -1.5, 0}, {1.5, 1.5, 2.4}};

recon::ReconstructOptions reconstruct_options(const FightOptions& fight) {
  recon::ReconstructOptions chosen = options(fight.voxel_m, 0);
  chosen.bounds = kSpace;
  return chosen;
}

/// The true surface of one performer.
class TrueSurface {
 public:
  TrueSurface(const sim::Performer& performer, double seconds, uint64_t seed)
      : mesh_(sim::outer_surface(sim::performer_parts(seconds, seed, performer), seed)),
        nearest_(mesh_) {
    for (const Eigen::Vector3f& v : mesh_.vertices) box_.extend(v.cast<double>());
  }
  TrueSurface(const TrueSurface&) = delete;  // nearest_ refers to mesh_
  TrueSurface& operator=(const TrueSurface&) = delete;

  double distance_of(const Eigen::Vector3d& p) const { return nearest_.find(p).value().distance; }
  /// At most distance_of(), and fast.
  double box_distance_of(const Eigen::Vector3d& p) const { return box_.exteriorDistance(p); }

 private:
  Mesh mesh_;
  recon::NearestTriangle nearest_;
  Eigen::AlignedBox3d box_;
};

bool is_first_nearer(const TrueSurface& first, const TrueSurface& second,
                     const Eigen::Vector3d& p) {
  if (second.box_distance_of(p) < first.box_distance_of(p)) {
    const double to_second = second.distance_of(p);
    return first.box_distance_of(p) <= to_second && first.distance_of(p) <= to_second;
  }
  const double to_first = first.distance_of(p);
  return second.box_distance_of(p) >= to_first || second.distance_of(p) >= to_first;
}

/// By vertex the performer with the nearest surface; 1 of two equally near ones.
std::vector<uint8_t> true_performers(const Mesh& mesh, double seconds, uint64_t seed) {
  const std::vector<sim::Performer> cast = sim::cast_of(kPerformers);
  const TrueSurface first(cast[0], seconds, seed), second(cast[1], seconds, seed);
  std::vector<uint8_t> truth(mesh.vertices.size());
  tbb::parallel_for(size_t{0}, truth.size(), [&](size_t v) {
    truth[v] = is_first_nearer(first, second, mesh.vertices[v].cast<double>()) ? 1 : 2;
  });
  return truth;
}

}  // namespace

double processor_ms() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return 1e3 * static_cast<double>(now.tv_sec) + 1e-6 * static_cast<double>(now.tv_nsec);
}

Fight::Fight(const FightOptions& options)
    : options_(options),
      rig_(sim::make_rig(options.cameras, kSize, options.seed)),
      renderer_(rig_, {.seed = options.seed, .cast = sim::cast_of(kPerformers)}),
      reconstructor_(rig_, reconstruct_options(options)) {
  if (!options.exact) segmenters_ = learnt_segmenters(renderer_);
}

recon::FrameSet Fight::frames(double seconds, int number) {
  const std::vector<Image> images =
      renderer_.render_all(seconds, uint64_t{kPlates} + static_cast<uint64_t>(number));
  recon::FrameSet set;
  set.pulse = number;
  set.frames.resize(rig_.size());
  tbb::parallel_for(size_t{0}, rig_.size(), [&](size_t c) {
    const ImageView image = images[c].view();
    Mask mask = options_.exact ? sim::true_silhouette(rig_[c], seconds, options_.seed, kPerformers)
                               : segmenters_[c].segment(image);
    set.frames[c] = observe(rig_[c].name, {}, image, std::move(mask));
  });
  return set;
}

FightPulse Fight::pulse(int number) {
  const double seconds = number / options_.rate_hz;
  recon::FrameSetJob job(frames(seconds, number));
  const double begin = processor_ms();
  reconstructor_.make_mesh(job);
  reconstructor_.encode(job);
  FightPulse pulse;
  pulse.live_ms = processor_ms() - begin;
  pulse.truth = true_performers(job.result.mesh, seconds, options_.seed);
  pulse.volume = std::move(job.volume);
  return pulse;
}

}  // namespace v3d::bench
