// v3d-performers: measures how well the performers of a simulated fight keep their identities.
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdio>
#include <ctime>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/core/error.h"
#include "base/geometry/camera_model.h"
#include "capture/segmentation/segmenter.h"
#include "cli/command.h"
#include "recon/hull/volume_components.h"
#include "recon/metrics/nearest_triangle.h"
#include "recon/performers/performer_tracker.h"
#include "recon/pipeline/reconstructor.h"
#include "sim/performer/performer.h"
#include "sim/rendering/camera_images.h"
#include "sim/rendering/scene.h"
#include "workload.h"

namespace v3d::bench {
namespace {

// A simulated fight as hulls with the true performer of every vertex.

struct FightOptions {
  uint64_t seed = 1;
  int cameras = 15;
  double voxel_m = 0.01;
  double rate_hz = 25;
  bool exact = false;  ///< true silhouettes instead of segmented images
};

struct FightPulse {
  recon::SparseVolume volume;  ///< the visual hull
  /// By vertex of its MarchingCubes surface the performer, 1 or 2, whose true surface is nearest.
  std::vector<uint8_t> truth;
  double live_ms = 0;  ///< processor time of the live reconstruction, without segmentation
};

/// Processor time of this process so far, milliseconds.
double processor_ms();

/// Renders, segments and reconstructs the pulses of a fight of two simulated performers.
class Fight {
 public:
  explicit Fight(const FightOptions& options);
  FightPulse pulse(int number);

 private:
  recon::FrameSet frames(double seconds, int number);

  FightOptions options_;
  Rig rig_;
  sim::BatchRenderer renderer_;
  std::vector<segmentation::Segmenter> segmenters_;
  recon::Reconstructor reconstructor_;
};

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

// The tracker on the fight.

struct Arguments {
  FightOptions fight;
  int frames = 200;
  int step = 1;
  double voxel_mm = 10;
};

struct Total {
  int64_t pulses = 0, vertices = 0, wrong = 0;
  double tracking_ms = 0, labelling_ms = 0, live_ms = 0;
};

/// Tracks the pulses in one way and compares the labels with the truth.
class Trial {
 public:
  Trial(std::string name, const recon::PerformerOptions& options)
      : name_(std::move(name)), tracker_(options) {}

  void add(int number, const FightPulse& pulse, bool in_contact) {
    const double begin = processor_ms();
    const auto& performers = tracker_.add(number, pulse.volume);
    const double middle = processor_ms();
    const std::vector<uint8_t> labels = labels_.find(pulse.volume, performers);
    Total& total = totals_[in_contact];
    total.labelling_ms += processor_ms() - middle;
    total.tracking_ms += middle - begin;
    total.live_ms += pulse.live_ms;
    for (const auto& performer : performers)
      max_identity_ = std::max<int>(max_identity_, performer.identity);
    compare(labels, pulse.truth, total);
  }

  /// Times are of the processor, and means over the pulses.
  void print() const {
    const Total& apart = totals_[0];
    const Total& contact = totals_[1];
    const Total all{apart.pulses + contact.pulses, apart.vertices + contact.vertices,
                    apart.wrong + contact.wrong};
    std::printf("%s\n  identities %d, switches %d\n", name_.c_str(), max_identity_, switches_);
    std::printf("  wrong labels %.2f %%; in contact %.2f %%, apart %.2f %%, worst pulse %.1f %%\n",
                percent(all), percent(contact), percent(apart), worst_);
    for (const auto& [state, total] : {std::pair("contact", contact), std::pair("apart", apart)}) {
      const auto pulses = static_cast<double>(std::max<int64_t>(total.pulses, 1));
      std::printf(
          "  %s, %lld pulses: tracking %.1f ms, labels of vertices %.1f ms, live frame %.1f ms\n",
          state, static_cast<long long>(total.pulses), total.tracking_ms / pulses,
          total.labelling_ms / pulses, total.live_ms / pulses);
    }
  }

 private:
  static double percent(const Total& total) {
    return 100.0 * static_cast<double>(total.wrong) /
           static_cast<double>(std::max<int64_t>(total.vertices, 1));
  }

  /// The identities of the first pulse are those of the true performers. A switch: most vertices of
  /// a true performer have another label than in the pulse before.
  void compare(const std::vector<uint8_t>& labels, const std::vector<uint8_t>& truth,
               Total& total) {
    V3D_CHECK(labels.size() == truth.size());
    std::array<std::array<int64_t, 256>, 3> counts{};
    for (size_t v = 0; v < labels.size(); ++v) ++counts[truth[v]][labels[v]];
    int64_t wrong = static_cast<int64_t>(labels.size());
    for (const size_t p : {1, 2}) {
      const auto identity = std::ranges::max_element(counts[p]) - counts[p].begin();
      if (first_[p] < 0) first_[p] = latest_[p] = static_cast<int>(identity);
      if (latest_[p] != identity) ++switches_;
      latest_[p] = static_cast<int>(identity);
      wrong -= counts[p][static_cast<size_t>(first_[p])];
    }
    if (first_[1] == first_[2]) throw InputError("the performers begin with the same label");
    ++total.pulses;
    total.vertices += std::ssize(labels);
    total.wrong += wrong;
    worst_ = std::max(worst_, percent({1, std::ssize(labels), wrong}));
  }

  std::string name_;
  recon::PerformerTracker tracker_;
  recon::VertexLabels labels_;
  std::array<int, 3> first_{-1, -1, -1}, latest_{-1, -1, -1};  ///< by true performer
  int max_identity_ = 0, switches_ = 0;
  double worst_ = 0;
  std::array<Total, 2> totals_{};  ///< apart, in contact
};

/// Whether one component has voxels of both performers: then only one is large.
bool is_in_contact(recon::VolumeComponents& components, const recon::SparseVolume& volume) {
  components.find(volume);
  const int64_t largest = components.voxels(components.largest());
  return 10 * largest > 9 * volume.count();
}

void run(const Arguments& arguments) {
  Fight fight(arguments.fight);
  recon::PerformerOptions unmoved;
  unmoved.follow_contact_motion = false;
  Trial trials[] = {{"border follows the motion", {}}, {"border stays until it grows", unmoved}};
  recon::VolumeComponents components;
  for (int number = 0; number < arguments.frames; number += arguments.step) {
    const FightPulse pulse = fight.pulse(number);
    const bool in_contact = is_in_contact(components, pulse.volume);
    for (Trial& trial : trials) trial.add(number, pulse, in_contact);
  }
  std::printf("seed %llu, %d cameras, %.3g mm, %s silhouettes, every %d of %d frames\n",
              static_cast<unsigned long long>(arguments.fight.seed), arguments.fight.cameras,
              arguments.voxel_mm, arguments.fight.exact ? "true" : "segmented", arguments.step,
              arguments.frames);
  for (const Trial& trial : trials) trial.print();
}

}  // namespace
}  // namespace v3d::bench

int main(int argc, char** argv) {
  using v3d::cli::integer_in;
  v3d::bench::Arguments arguments;
  v3d::cli::Program app{
      "Tracks the two performers of a simulated fight in visual hulls, and prints how often an "
      "identity changes and which part of the vertices has a wrong label: another one than the "
      "nearest true surface."};
  app.add_option("--seed", arguments.fight.seed, "Studio and performers").show_default();
  app.add_option("--cameras", arguments.fight.cameras).show_default().check(integer_in(4, 60));
  app.add_option("--frames", arguments.frames, "At 25 pulses per second")
      .show_default()
      .check(integer_in(1, 100'000));
  app.add_option("--step", arguments.step, "Use every N-th frame only, as with dropped pulses")
      .show_default()
      .check(integer_in(1, 100));
  app.add_option("--voxel", arguments.voxel_mm, "Millimetres")
      .show_default()
      .check(v3d::cli::number_in(2, 50));
  app.add_flag("--exact", arguments.fight.exact, "True silhouettes instead of segmented images");
  if (const auto status = app.parse_or_report(argc, argv)) return *status;
  arguments.fight.voxel_m = arguments.voxel_mm / 1000;
  try {
    v3d::bench::run(arguments);
  } catch (const v3d::InputError& error) {
    std::fprintf(stderr, "v3d-performers: %s\n", error.what());
    return 2;
  }
  return 0;
}
