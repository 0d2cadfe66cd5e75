#include "v3dctl/reconstruct/take_reconstruction.h"

#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>
#include <unistd.h>

#include <algorithm>
#include <optional>
#include <utility>

#include "base/core/error.h"
#include "base/core/time.h"
#include "base/geometry/rigid_transform.h"
#include "base/image/mask_operations.h"
#include "base/io/file.h"
#include "common/console.h"
#include "recon/hull/voxel_grid.h"
#include "recon/pipeline/frame_pipeline.h"
#include "recon/render/renderer.h"

namespace v3d::ctl {
namespace {

namespace fs = std::filesystem;

// Compares the rendered silhouettes of the surface with the masks, within the view of the bounds.
class SilhouetteMeter {
 public:
  SilhouetteMeter(const Rig& rig, const Box& bounds) : views_(rig.size()) {
    for (const RigCamera& camera : rig) models_.push_back(camera.model);
    tbb::parallel_for(size_t{0}, rig.size(),
                      [&](size_t i) { views_[i] = recon::bounds_mask(bounds, models_[i]); });
  }

  void measure(const Mesh& mesh, const std::vector<std::optional<recorded::SegmentedFrame>>& frames,
               ReconstructReport& report) const {
    const std::vector<Mask> rendered = recon::draw_silhouettes(mesh, models_);
    for (size_t i = 0; i < rendered.size(); ++i) {
      if (!frames[i] || frames[i]->mask.size() != views_[i].size()) continue;
      const Mask mask = intersection_of(frames[i]->mask, views_[i]);
      // The intersection over union of two empty masks is undefined.
      if (rendered[i].count() + mask.count() == 0) continue;
      const double iou = intersection_over_union(rendered[i], mask);
      report.silhouette_iou.push_back(iou);
      report.camera_iou[i].push_back(iou);
    }
  }

 private:
  std::vector<CameraModel> models_;
  std::vector<Mask> views_;
};

void add_stage_times(const recon::StageTimes& times, double segment, ReconstructReport& report) {
  const double parts[] = {segment,         times.intersect, times.mesh,   times.deform,
                          times.smoothing, times.texture,   times.encode, times.quality};
  double total = 0;
  for (size_t stage = 0; stage < std::size(parts); ++stage) {
    if (parts[stage] < 0) continue;
    report.stages[stage].ms.push_back(parts[stage]);
    total += parts[stage];
  }
  report.stages.back().ms.push_back(total);
}

void add_measurements(const recon::Reconstruction& result, ReconstructReport& report) {
  ++report.frames;
  report.volume_m3.push_back(result.volume_m3);
  report.vertices.push_back(static_cast<double>(result.mesh.vertices.size()));
  report.triangles.push_back(static_cast<double>(result.mesh.triangles.size()));
  report.components.push_back(connected_components(result.mesh));
  report.ghosts.push_back(result.ghosts);
  report.bytes.push_back(static_cast<double>(result.compact.size()));
  report.quality.emplace_back(result.pulse, result.quality);
}

/// Faults of the requested pulses; their neighbours were compared, too.
std::vector<PulseFault> faults_among(std::span<const int64_t> pulses,
                                     const std::vector<PulseFault>& all) {
  std::vector<PulseFault> faults;
  std::copy_if(all.begin(), all.end(), std::back_inserter(faults), [&](const PulseFault& fault) {
    return std::binary_search(pulses.begin(), pulses.end(), fault.pulse);
  });
  return faults;
}

}  // namespace

// Stages of the live reconstruction, preceded by reading and segmentation and followed by
// measuring.
class TakeReconstruction::Impl {
 public:
  Impl(const ReconstructRequest& complete, int threads, recorded::TakeFrames&& take)
      : take_(std::move(take)),
        options_(options_of(complete, threads)),
        reconstructor_(take_.rig(), options_),
        silhouettes_(tbb::task_arena(threads).execute(
            [&] { return SilhouetteMeter(take_.rig(), options_.bounds); })),
        repair_(complete.repair
                    ? std::optional<TakeSilhouetteRepair>(std::in_place, take_.rig(), options_)
                    : std::nullopt),
        live_repair_(complete.repair_pulses
                         ? std::optional<LivePulseRepair>(std::in_place, take_.rig(), options_,
                                                          *complete.repair_pulses)
                         : std::nullopt),
        passes_(complete.pulse_passes),
        surfaces_(take_, reconstructor_, passes_, repair_ ? &*repair_ : nullptr,
                  live_repair_ ? &*live_repair_ : nullptr,
                  complete.smooth && options_.quality == Quality::kHigh) {}

  ReconstructReport make(std::span<const int64_t> pulses, PendingMeshFile& file,
                         const std::function<void()>& on_frame) {
    ReconstructReport report = empty_report(take_.rig(), options_, repair_ || live_repair_);
    auto next = pulses.begin();
    reconstructor_.begin_sequence();
    recon::FramePipeline<Job>(
        options_.threads,
        [&]() -> std::optional<Job> {
          stop_if_interrupted();
          if (next == pulses.end()) return std::nullopt;
          return Job{*next++};
        },
        {[&](Job& job) { make_mesh(job); }, [&](Job& job) { encode(job, file); },
         [&](Job& job) {
           measure(job, report);
           on_frame();
         }})
        .wait();
    if (repair_) report.silhouette_faults = faults_among(pulses, repair_->faults());
    if (live_repair_) report.silhouette_faults = faults_among(pulses, live_repair_->faults());
    report.read_errors = take_.read_errors();
    report.peak_rss_mb = peak_rss_mb();
    return report;
  }

 private:
  struct Job {
    int64_t pulse = 0;
    TakeSurface made{};
  };

  void make_mesh(Job& job) {
    job.made = surfaces_.make(job.pulse);
    reconstructor_.make_colours(job.made.work);
  }

  void encode(Job& job, PendingMeshFile& file) {
    reconstructor_.encode(job.made.work);
    file.append(job.pulse, job.made.work.result.compact);
  }

  void measure(Job& job, ReconstructReport& report) const {
    const recon::Reconstruction& result = job.made.work.result;
    silhouettes_.measure(result.mesh, job.made.frames, report);
    add_stage_times(result.times, job.made.segment_ms, report);
    add_measurements(result, report);
    if (result.cameras.size() < take_.rig().size()) ++report.incomplete;
  }

  recorded::TakeFrames take_;
  const recon::ReconstructOptions options_;
  recon::Reconstructor reconstructor_;
  const SilhouetteMeter silhouettes_;
  std::optional<TakeSilhouetteRepair> repair_;
  std::optional<LivePulseRepair> live_repair_;
  const std::map<int64_t, int> passes_;
  TakeSurfaces surfaces_;
};

TakeReconstruction::TakeReconstruction(const ReconstructRequest& complete, int threads,
                                       recorded::TakeFrames take)
    : impl_(std::make_unique<Impl>(complete, threads, std::move(take))) {}
TakeReconstruction::~TakeReconstruction() = default;

ReconstructReport TakeReconstruction::make(std::span<const int64_t> pulses, PendingMeshFile& file,
                                           const std::function<void()>& on_frame) {
  return impl_->make(pulses, file, on_frame);
}

ReconstructReport reconstruct_take(const ReconstructRequest& request) {
  const MonotonicInstant begin = Monotonic::now();
  recorded::TakeFrames take = open_take(request);
  const std::vector<int64_t> pulses = pulses_of(request, take);
  const int64_t without_frames = pulses_without_frames(request, take);
  const fs::path path = take.paths().mesh();
  const ReconstructRequest complete = with_defaults(request, take);
  TakeReconstruction reconstruction(complete, threads_of(request), std::move(take));
  PendingMeshFile file(path);
  Progress progress("reconstruct", std::ssize(pulses));
  ReconstructReport report = reconstruction.make(pulses, file, [&] { progress.advance(); });
  file.finish();
  report.incomplete += without_frames;
  report.seconds = to_seconds(Monotonic::now() - begin);
  return report;
}

// --- the mesh file

std::string process_suffix() { return host_name() + "-" + std::to_string(getpid()); }

PendingMeshFile::PendingMeshFile(const fs::path& path)
    : path_(path),
      temporary_path_(path.string() + ".partial-" + process_suffix()),
      file_(temporary_path_) {}

PendingMeshFile::~PendingMeshFile() {
  std::error_code ignored;
  if (!finished_) fs::remove(temporary_path_, ignored);
}

void PendingMeshFile::append(int64_t pulse, const std::vector<uint8_t>& compact) {
  io::throw_if_failed(file_.append(pulse, compact));
}

void PendingMeshFile::finish() {
  io::throw_if_failed(file_.close());
  fs::rename(temporary_path_, path_);
  finished_ = true;
  io::throw_if_failed(io::sync_folder(fs::absolute(path_).parent_path()));
}

TakeSurfaces::TakeSurfaces(recorded::TakeFrames& take, recon::Reconstructor& reconstructor,
                           const std::map<int64_t, int>& passes, TakeSilhouetteRepair* repair,
                           LivePulseRepair* live_repair, bool smooth)
    : take_(take),
      reconstructor_(reconstructor),
      passes_(passes),
      repair_(repair),
      live_repair_(live_repair),
      smooth_(smooth),
      pulses_(take.pulses()) {}

TakeSurface TakeSurfaces::make(int64_t pulse) {
  if (!smooth_) {
    TakeSurface made = read(pulse);
    reconstructor_.make_surface(made.work);
    return made;
  }
  constexpr int kWindowReach = 2;
  std::erase_if(window_, [&](const auto& entry) {
    return entry.first < pulse - kWindowReach || entry.first > pulse + kWindowReach;
  });
  for (int64_t p = pulse - kWindowReach; p <= pulse + kWindowReach; ++p) make_hull(p);
  for (int64_t p = pulse - 1; p <= pulse + 1; ++p) deform(p);
  WindowEntry& now = window_.at(pulse);
  TakeSurface made = std::move(now.surface);
  const MonotonicInstant smoothing = Monotonic::now();
  reconstructor_.deform_stage().smooth(now.views, neighbours(pulse), made.work.result.mesh);
  made.work.result.times.smoothing = recon::milliseconds_since(smoothing);
  return made;
}

TakeSurface TakeSurfaces::read(int64_t pulse) {
  const MonotonicInstant begin = Monotonic::now();
  TakeSurface made;
  if (repair_ != nullptr) set_previous_of(pulse);
  made.frames = pulse == next_pulse_ ? std::move(next_) : take_.read(pulse);
  if (repair_ != nullptr) repair(pulse, made.frames);
  made.work = recon::FrameSetJob(observe_all(pulse, made.frames));
  if (live_repair_ != nullptr) live_repair_->repair(made.work.set, made.frames);
  made.work.set.exposure = take_.edge_of(pulse);
  if (const auto found = passes_.find(pulse); found != passes_.end()) {
    made.work.live_passes = found->second;
  }
  made.segment_ms = recon::milliseconds_since(begin);
  return made;
}

/// Reads the pulse before, where a shard begins.
void TakeSurfaces::set_previous_of(int64_t pulse) {
  if (!has(pulse - 1) || repair_->is_previous(pulse - 1)) return;
  repair_->set_previous(pulse - 1, take_.read(pulse - 1));
}

void TakeSurfaces::repair(int64_t pulse, SegmentedFrames& frames) {
  next_pulse_ = pulse + 1;
  next_ = take_.read(next_pulse_);
  repair_->repair(pulse, frames, next_);
}

bool TakeSurfaces::has(int64_t pulse) const {
  return std::binary_search(pulses_.begin(), pulses_.end(), pulse);
}

/// Makes the carved hull of a pulse once.
void TakeSurfaces::make_hull(int64_t pulse) {
  if (!has(pulse) || window_.contains(pulse)) return;
  TakeSurface surface = read(pulse);
  recon::FrameSetJob& work = surface.work;
  reconstructor_.make_hull(work);
  const MonotonicInstant observing = Monotonic::now();
  recon::PulseViews views =
      reconstructor_.deform_stage().views(work.frames, work.volume, work.result.mesh);
  work.result.times.deform = recon::milliseconds_since(observing);
  window_.emplace(pulse, WindowEntry{std::move(surface), std::move(views)});
}

/// Deforms the surface of a pulse once. Requires the hulls of its neighbours.
void TakeSurfaces::deform(int64_t pulse) {
  const auto found = window_.find(pulse);
  if (found == window_.end() || found->second.deformed) return;
  auto& [surface, views, deformed] = found->second;
  recon::FrameSetJob& work = surface.work;
  const MonotonicInstant deforming = Monotonic::now();
  reconstructor_.deform_stage().deform(views, neighbours(pulse), work.volume, work.result.mesh);
  work.result.times.deform += recon::milliseconds_since(deforming);
  deformed = true;
}

/// Views of the pulses before and after, as far as the take has them.
std::vector<const recon::PulseViews*> TakeSurfaces::neighbours(int64_t pulse) const {
  std::vector<const recon::PulseViews*> neighbours;
  for (const int64_t p : {pulse - 1, pulse + 1}) {
    if (const auto found = window_.find(p); found != window_.end()) {
      neighbours.push_back(&found->second.views);
    }
  }
  return neighbours;
}

}  // namespace v3d::ctl
