#include "v3dctl/reconstruct.h"

#include <sys/resource.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <thread>

#include "base/error.h"
#include "base/mask_shape.h"
#include "base/units.h"
#include "common/console.h"
#include "recon/box_view.h"
#include "recon/frame_pipeline.h"
#include "recon/reconstructor.h"
#include "recon/silhouette.h"
#include "take/mesh_file.h"
#include "v3dctl/interrupt.h"
#include "v3dctl/take_frames.h"
#include "v3dctl/take_surfaces.h"
#include "v3dctl/working_space.h"

namespace v3d::ctl {
namespace {

namespace fs = std::filesystem;

class Stopwatch {
 public:
  double seconds() const {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
  }
  double ms() const { return 1000 * seconds(); }

 private:
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

// mesh.v3d under another name until it is whole.
class PendingMeshFile {
 public:
  explicit PendingMeshFile(const fs::path& place)
      : place_(place),
        path_(place.string() + ".partial-" + std::to_string(getpid())),
        file_(path_) {}
  ~PendingMeshFile() {
    std::error_code ignored;
    if (!moved_) fs::remove(path_, ignored);
  }
  PendingMeshFile(const PendingMeshFile&) = delete;
  PendingMeshFile& operator=(const PendingMeshFile&) = delete;

  void append(int64_t pulse, const std::vector<uint8_t>& compact) {
    if (!file_.append(pulse, compact)) refuse();
  }
  void finish() {
    if (!file_.close()) refuse();
    fs::rename(path_, place_);
    moved_ = true;
  }

 private:
  [[noreturn]] void refuse() const {
    throw std::runtime_error(path_.string() + ": cannot write: is the disk full?");
  }

  fs::path place_;
  fs::path path_;
  MeshFileWriter file_;
  bool moved_ = false;
};

ReconstructOptions choose_options(const ReconstructRequest& request, const TakeFrames& take,
                                  int threads) {
  const Studio* studio =
      request.studio && request.studio->name == take.info().studio ? &*request.studio : nullptr;
  const int cameras = static_cast<int>(take.rig().size());
  ReconstructOptions options;
  options.threads = threads;
  options.voxel_m = request.voxel_m.value_or(studio ? studio->reconstruction.voxel_m : 0.01);
  options.quality =
      request.quality.value_or(studio ? studio->reconstruction.quality : Quality::kLive);
  options.deform = request.deform;
  options.min_views = request.min_views.value_or(
      std::min(cameras, studio ? studio->reconstruction.min_views : default_min_views(cameras)));
  if (options.min_views > cameras) {
    throw InputError("--min-views " + std::to_string(options.min_views) + ": only " +
                     std::to_string(cameras) + " cameras take part");
  }
  if (request.bounds || studio) {
    options.bounds = request.bounds ? *request.bounds : studio->space.bounds;
  } else {
    options.bounds = common_view(take.rig(), std::max(options.min_views, (cameras + 1) / 2));
    const Box& box = options.bounds;
    char text[160];
    std::snprintf(
        text, sizeof text,
        "bounds: where at least half the cameras look: --bounds %.3f,%.3f,%.3f,%.3f,%.3f,%.3f",
        box.min.x(), box.min.y(), box.min.z(), box.max.x(), box.max.y(), box.max.z());
    note(text);
  }
  return options;
}

std::vector<int64_t> choose_pulses(const TakeFrames& take, FrameRange range) {
  const std::vector<int64_t> all = take.pulses();
  if (all.empty()) throw InputError(take.paths().folder.string() + ": the take holds no frames");
  std::vector<int64_t> pulses;
  std::copy_if(all.begin(), all.end(), std::back_inserter(pulses),
               [&](int64_t pulse) { return range.contains(pulse); });
  if (pulses.empty()) {
    throw InputError("--frames: the take has none of them; it has " + std::to_string(all.front()) +
                     " to " + std::to_string(all.back()));
  }
  return pulses;
}

int64_t pulses_without_frames(const TakeInfo& info, FrameRange range, size_t with_frames) {
  const int64_t end = std::min(info.pulses, range.end);
  return std::max<int64_t>(0, end - range.begin - static_cast<int64_t>(with_frames));
}

// How well the surface, drawn into each camera, covers its mask. What a camera sees beside the
// bounds is not the surface's to cover.
class SilhouetteMeter {
 public:
  SilhouetteMeter(const Rig& rig, const Box& bounds) : views_(rig.size()) {
    for (const RigCamera& camera : rig) models_.push_back(camera.model);
    tbb::parallel_for(size_t{0}, rig.size(),
                      [&](size_t i) { views_[i] = view_of(bounds, models_[i]); });
  }

  void measure(const Mesh& mesh, const std::vector<std::optional<SegmentedFrame>>& frames,
               ReconstructReport& report) const {
    const std::vector<Mask> drawn = draw_silhouettes(mesh, models_);
    for (size_t i = 0; i < drawn.size(); ++i) {
      if (!frames[i] || frames[i]->mask.size() != views_[i].size()) continue;
      const Mask mask = both(frames[i]->mask, views_[i]);
      // Where both are empty there is nothing to measure.
      if (drawn[i].count() + mask.count() == 0) continue;
      const double iou = intersection_over_union(drawn[i], mask);
      report.silhouette_iou.push_back(iou);
      report.camera_iou[i].push_back(iou);
    }
  }

 private:
  std::vector<CameraModel> models_;
  std::vector<Mask> views_;
};

void add_stage_times(const StageTimes& times, double segment, ReconstructReport& report) {
  const double parts[] = {segment,      times.intersect, times.mesh,   times.deform,
                          times.steady, times.texture,   times.encode, times.quality};
  double total = 0;
  for (size_t stage = 0; stage < std::size(parts); ++stage) {
    if (parts[stage] < 0) continue;
    report.stages[stage].ms.push_back(parts[stage]);
    total += parts[stage];
  }
  report.stages.back().ms.push_back(total);
}

void add_figures(const Reconstruction& result, ReconstructReport& report) {
  ++report.frames;
  report.volume_m3.push_back(result.volume_m3);
  report.vertices.push_back(static_cast<double>(result.mesh.vertices.size()));
  report.triangles.push_back(static_cast<double>(result.mesh.triangles.size()));
  report.components.push_back(connected_components(result.mesh));
  report.bytes.push_back(static_cast<double>(result.compact.size()));
  report.quality.emplace_back(result.pulse, result.quality);
}

double peak_rss_mb() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) * 1024 / 1e6;
}

ReconstructReport begin_report(const ReconstructOptions& options, const TakeFrames& take) {
  ReconstructReport report;
  for (const RigCamera& camera : take.rig()) report.cameras.push_back(camera.name);
  report.camera_iou.resize(take.rig().size());
  report.bounds = options.bounds;
  report.voxel_m = options.voxel_m;
  report.min_views = options.min_views;
  report.threads = options.threads;
  for (const char* stage : {"segment", "intersect", "mesh", "deform", "steady", "texture", "encode",
                            "quality", "total"}) {
    report.stages.push_back({stage, {}});
  }
  return report;
}

/// The pulses beside those that are asked for are looked at too.
std::vector<PulseFault> faults_among(const std::vector<int64_t>& pulses,
                                     const std::vector<PulseFault>& all) {
  std::vector<PulseFault> faults;
  std::copy_if(all.begin(), all.end(), std::back_inserter(faults), [&](const PulseFault& fault) {
    return std::binary_search(pulses.begin(), pulses.end(), fault.pulse);
  });
  return faults;
}

// The frames of a take on their way to mesh.v3d. The stages are those of the live reconstruction,
// with the reading and segmenting before and the measuring behind.
class Run {
 public:
  Run(const ReconstructRequest& request, int threads)
      : take_(request.take, cameras_without(load_take_info({request.take}), request.leave_out)),
        pulses_(choose_pulses(take_, request.frames)),
        options_(choose_options(request, take_, threads)),
        reconstructor_(take_.rig(), options_),
        silhouettes_(tbb::task_arena(threads).execute(
            [&] { return SilhouetteMeter(take_.rig(), options_.bounds); })),
        mending_(request.mend ? std::optional<MaskMending>(std::in_place, take_.rig(), options_)
                              : std::nullopt),
        surfaces_(take_, reconstructor_, mending_ ? &*mending_ : nullptr,
                  request.steady && options_.quality == Quality::kHigh),
        report_(begin_report(options_, take_)),
        file_(take_.paths().mesh()),
        progress_("reconstruct", std::ssize(pulses_)) {
    report_.incomplete = pulses_without_frames(take_.info(), request.frames, pulses_.size());
  }

  ReconstructReport all() {
    FramePipeline<Job>(options_.threads, [this] { return next(); },
                       {[this](Job& job) { make_mesh(job); }, [this](Job& job) { encode(job); },
                        [this](Job& job) { measure(job); }})
        .wait();
    file_.finish();
    report_.mended = mending_.has_value();
    if (mending_) report_.silhouette_faults = faults_among(pulses_, mending_->faults());
    return std::move(report_);
  }

 private:
  struct Job {
    int64_t pulse = 0;
    TakeSurface made{};
  };

  std::optional<Job> next() {
    stop_if_interrupted();
    if (next_ == pulses_.size()) return std::nullopt;
    return Job{pulses_[next_++]};
  }

  void make_mesh(Job& job) {
    job.made = surfaces_.make(job.pulse);
    reconstructor_.make_colours(job.made.work);
  }

  void encode(Job& job) {
    reconstructor_.encode(job.made.work);
    file_.append(job.pulse, job.made.work.result.compact);
  }

  void measure(Job& job) {
    const Reconstruction& result = job.made.work.result;
    silhouettes_.measure(result.mesh, job.made.frames, report_);
    add_stage_times(result.times, job.made.segment_ms, report_);
    add_figures(result, report_);
    if (result.cameras.size() < take_.rig().size()) ++report_.incomplete;
    progress_.advance();
  }

  TakeFrames take_;
  const std::vector<int64_t> pulses_;
  const ReconstructOptions options_;
  Reconstructor reconstructor_;
  const SilhouetteMeter silhouettes_;
  std::optional<MaskMending> mending_;
  TakeSurfaces surfaces_;
  ReconstructReport report_;
  PendingMeshFile file_;
  Progress progress_;
  size_t next_ = 0;
};

}  // namespace

int default_min_views(int cameras) { return std::clamp(cameras - 1, 1, 4); }

ReconstructReport reconstruct_take(const ReconstructRequest& request) {
  const Stopwatch run;
  const int threads = request.threads > 0
                          ? request.threads
                          : std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
  ReconstructReport report = Run(request, threads).all();
  report.seconds = run.seconds();
  report.peak_rss_mb = peak_rss_mb();
  return report;
}

}  // namespace v3d::ctl
