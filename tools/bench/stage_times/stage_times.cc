// v3d-stage-times: measures the processor time of every stage from raw frames to compact frames, in
// live quality, on one thread. tools/bench/scaling fits a model to it.
#include <tbb/global_control.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <ctime>
#include <filesystem>
#include <iterator>
#include <limits>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "base/core/error.h"
#include "base/core/statistics.h"
#include "base/core/text.h"
#include "base/geometry/rigid_transform.h"
#include "capture/segmentation/segmenter.h"
#include "cli/command.h"
#include "recon/hull/intersect.h"
#include "recon/hull/sparse_volume.h"
#include "recon/metrics/frame_quality.h"
#include "recon/pipeline/compact_frame.h"
#include "recon/pipeline/reconstructor.h"
#include "take/logs/frame_log.h"
#include "take/take.h"

namespace v3d::bench {
namespace {

using nlohmann::json;

/// Processor time of this thread. Unlike the wall clock, it does not include waiting for a
/// processor.
double thread_cpu_ms() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return 1e3 * static_cast<double>(now.tv_sec) + 1e-6 * static_cast<double>(now.tv_nsec);
}

/// The raw frames of a take in memory, and a segmenter for each camera.
class Recording {
 public:
  explicit Recording(const std::filesystem::path& take) {
    const take::TakePaths paths{take};
    const Rig calibrated = load_take_calib(paths);
    for (const std::string& name : load_take_info(paths).cameras) {
      const int c = find_camera(calibrated, name);
      if (c < 0) throw InputError(paths.calib().string() + ": no calibration of " + name);
      rig_.push_back(calibrated[c]);
      segmenters_.emplace_back(segmentation::load_background(paths.background(), name),
                               segmentation::SegmentOptions{});
      read(paths.frames(name));
    }
    std::erase_if(pulses_, [&](const auto& pulse) { return pulse.second.size() < rig_.size(); });
    if (pulses_.empty()) throw InputError(take.string() + ": no pulse with all cameras");
  }

  const Rig& rig() const { return rig_; }
  std::vector<segmentation::Segmenter>& segmenters() { return segmenters_; }
  /// Frames of every pulse that all cameras have, by pulse number, in the order of the rig.
  const std::map<int64_t, std::vector<Frame>>& pulses() const { return pulses_; }

 private:
  void read(const std::filesystem::path& log) {
    take::FrameLogReader reader(log);
    for (const FrameLabel& label : reader.labels()) {
      std::vector<Frame>& frames = pulses_[label.pulse];
      std::optional<Frame> frame = reader.read(label.pulse);
      if (frame && frames.size() + 1 == rig_.size()) frames.push_back(*std::move(frame));
    }
  }

  Rig rig_;
  std::vector<segmentation::Segmenter> segmenters_;
  std::map<int64_t, std::vector<Frame>> pulses_;
};

enum Stage { kSegment, kBox, kIntersect, kMesh, kTexture, kScore, kEncode, kStages };
constexpr const char* kNames[kStages] = {"segment", "box",   "intersect", "mesh",
                                         "texture", "score", "encode"};
using Times = std::array<double, kStages>;  ///< milliseconds

/// Sizes that determine the times.
struct Work {
  double vertices = 0, triangles = 0, bricks = 0;
  double box_pixels = 0;  ///< pixels in the boxes of all cameras
};

/// Width of a voxel at the nearest point of the surface, in pixels, for each camera.
std::vector<double> voxel_pixels(const Rig& rig, const Mesh& mesh, double voxel_m) {
  std::vector<double> pixels;
  for (const RigCamera& camera : rig) {
    double nearest = std::numeric_limits<double>::infinity();
    for (const Eigen::Vector3f& vertex : mesh.vertices) {
      const double z = (camera.model.cam_from_world() * vertex.cast<double>()).z();
      if (z > 0) nearest = std::min(nearest, z);
    }
    pixels.push_back(camera.model.matrix()(0, 0) * voxel_m / nearest);
  }
  return pixels;
}

/// Runs the stages of capture and of Reconstructor one after the other. Each pulse passes all
/// stages before the next one, so the caches are in a realistic state.
class Chain {
 public:
  Chain(Recording& recording, const recon::ReconstructOptions& options)
      : recording_(recording),
        grid_(recon::VoxelGrid::covering(options.bounds, options.voxel_m)),
        intersector_(grid_, models_of(recording.rig()), options.min_views),
        reconstructor_(recording.rig(), options),
        meter_(recording.rig(), options.bounds, options.voxel_m),
        encoder_({}) {}

  Times run(const std::vector<Frame>& raw) {
    Times times{};
    recon::FrameSetJob work;
    observe_all(raw, work.set, times);
    std::vector<const Mask*> masks;
    for (const Frame& frame : work.set.frames) {
      work.frames.push_back(&frame);
      masks.push_back(&*frame.mask);
    }
    const auto time = [&](Stage stage, const auto& run) {
      const double begin = thread_cpu_ms();
      run();
      times[stage] = thread_cpu_ms() - begin;
    };
    time(kIntersect, [&] { intersector_.intersect(masks, work.volume); });
    time(kMesh, [&] { marching_cubes_.run(work.volume, work.result.mesh); });
    time(kTexture, [&] { reconstructor_.make_colours(work); });
    time(kScore, [&] { work.result.quality = meter_.measure(work.result.mesh, work.frames); });
    time(kEncode, [&] { encode(work); });
    work_ = work_of(work);
    mesh_ = std::move(work.result.mesh);
    return times;
  }

  /// Results of the last pulse.
  const Work& work() const { return work_; }
  const Mesh& mesh() const { return mesh_; }

 private:
  void observe_all(const std::vector<Frame>& raw, recon::FrameSet& set, Times& times) {
    for (size_t c = 0; c < raw.size(); ++c) {
      const double begin = thread_cpu_ms();
      Mask mask = recording_.segmenters()[c].segment(raw[c].image.view());
      const double segmented = thread_cpu_ms();
      set.frames.push_back(
          observe(raw[c].camera, raw[c].label, raw[c].image.view(), std::move(mask)));
      times[kSegment] += segmented - begin;
      times[kBox] += thread_cpu_ms() - segmented;
    }
  }

  /// Encodes all pulses as one sequence, as the reconstruction does.
  void encode(recon::FrameSetJob& work) {
    Mesh& mesh = work.result.mesh;
    const codec::BrickVolume volume = work.volume.view();
    const std::vector<codec::VertexColour> colours = recon::vertex_colours(mesh.colours);
    const Eigen::Vector3d& origin = grid_.origin;
    codec::FrameContent content;
    content.metadata.pulse = encoded_++;
    content.metadata.cameras = work.result.cameras;
    content.metadata.origin = {origin.x(), origin.y(), origin.z()};
    content.metadata.step = grid_.voxel_m / 2;
    content.volume = &volume;
    content.triangles = mesh.triangles;
    content.colours = colours;
    if (!encoder_.encode(content)) throw InputError("the surface does not fit a compact frame");
    mesh.colours = recon::rgb_colours(encoder_.decoded_colours());
  }

  static Work work_of(const recon::FrameSetJob& work) {
    Work done;
    done.vertices = static_cast<double>(work.result.mesh.vertices.size());
    done.triangles = static_cast<double>(work.result.mesh.triangles.size());
    done.bricks = static_cast<double>(work.volume.bricks().size());
    for (const Frame& frame : work.set.frames) {
      done.box_pixels += static_cast<double>(frame.image.size.pixels());
    }
    return done;
  }

  Recording& recording_;
  const recon::VoxelGrid grid_;
  recon::Intersector intersector_;
  recon::MarchingCubes marching_cubes_;
  recon::Reconstructor reconstructor_;
  recon::QualityMeter meter_;
  codec::FrameEncoder encoder_;
  int64_t encoded_ = 0;
  Work work_;
  Mesh mesh_;
};

/// Lower quartile: disturbances only increase a time.
double undisturbed(std::vector<double> values) { return percentile(std::move(values), 0.25); }

/// Options of the reconstruction, and the times of the stages by pulse and round.
struct Setting {
  recon::ReconstructOptions options;
  std::unique_ptr<Chain> chain;
  Work sum;  ///< sum over all pulses
  std::map<int64_t, std::array<std::vector<double>, kStages>> times{};
};

void run_round(const Recording& recording, Setting& setting) {
  setting.sum = {};
  for (const auto& [pulse, raw] : recording.pulses()) {
    const Times times = setting.chain->run(raw);
    for (int s = 0; s < kStages; ++s) setting.times[pulse][s].push_back(times[s]);
    const Work& work = setting.chain->work();
    setting.sum.vertices += work.vertices;
    setting.sum.triangles += work.triangles;
    setting.sum.bricks += work.bricks;
    setting.sum.box_pixels += work.box_pixels;
  }
}

/// Means over the pulses.
json point_of(const Recording& recording, const Setting& setting) {
  const Rig& rig = recording.rig();
  const ImageSize size = rig[0].model.size();
  const double voxel_m = setting.options.voxel_m;
  const auto pulses = static_cast<double>(setting.times.size());
  json ms;
  for (int s = 0; s < kStages; ++s) {
    double total = 0;
    for (const auto& [pulse, stages] : setting.times) total += undisturbed(stages[s]);
    ms[kNames[s]] = total / pulses;
  }
  return {{"cameras", rig.size()},
          {"width", size.width},
          {"height", size.height},
          {"voxel_mm", 1000 * voxel_m},
          {"vertices", setting.sum.vertices / pulses},
          {"triangles", setting.sum.triangles / pulses},
          {"bricks", setting.sum.bricks / pulses},
          {"box_pixels", setting.sum.box_pixels / pulses},
          {"voxel_pixels", voxel_pixels(rig, setting.chain->mesh(), voxel_m)},
          {"ms", ms}};
}

struct Arguments {
  std::filesystem::path take;
  std::string bounds = "-1.5,-1.5,0,1.5,1.5,2";
  std::vector<std::string> voxels = {"10mm"};
  int rounds = 8;
};

json measure_all(const Arguments& arguments) {
  // All work must run in this thread, whose time is measured.
  const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
  Recording recording(arguments.take);
  std::vector<Setting> settings;
  for (const std::string& voxel : arguments.voxels) {
    recon::ReconstructOptions options;
    options.bounds = parse_bounds(arguments.bounds);
    options.voxel_m = parse_length(voxel);
    options.threads = 1;
    settings.push_back({options, std::make_unique<Chain>(recording, options), {}});
  }
  // Settings alternate, so that a disturbance of some seconds affects all of them a little.
  for (int round = 0; round < arguments.rounds; ++round) {
    for (Setting& setting : settings) run_round(recording, setting);
  }
  json points = json::array();
  for (const Setting& setting : settings) points.push_back(point_of(recording, setting));
  return points;
}

}  // namespace

}  // namespace v3d::bench

int main(int argc, char** argv) {
  v3d::bench::Arguments arguments;
  v3d::cli::Program app{
      "Measures the processor time of every stage from the raw frames of a take to compact frames, "
      "in live quality, on one thread. Prints JSON: for every voxel size the sizes of the surface, "
      "and milliseconds a pulse."};
  app.add_option("TAKE", arguments.take, "Take with raw frames and background models").required();
  app.add_option("--bounds", arguments.bounds, "X0,Y0,Z0,X1,Y1,Z1, metres").show_default();
  app.add_option("--voxel", arguments.voxels, "Edges of voxels, such as 8mm,10mm")
      .delimiter(',')
      .show_default();
  app.add_option("--rounds", arguments.rounds,
                 "Rounds through all pulses; the lower quartile is used")
      .show_default()
      .check(v3d::cli::integer_in(1, 1000));
  if (const auto status = app.parse_or_report(argc, argv)) return *status;
  try {
    std::printf("%s\n", v3d::bench::measure_all(arguments).dump(1).c_str());
  } catch (const v3d::InputError& error) {
    std::fprintf(stderr, "v3d-stage-times: %s\n", error.what());
    return v3d::kExitBadInput;
  }
  return 0;
}
