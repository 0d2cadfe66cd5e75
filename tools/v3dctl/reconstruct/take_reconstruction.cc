#include "v3dctl/reconstruct/take_reconstruction.h"

#include <sys/resource.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>
#include <unistd.h>

#include <algorithm>
#include <optional>
#include <utility>

#include "base/core/error.h"
#include "base/core/time.h"
#include "base/geometry/box.h"
#include "base/image/mask_morphology.h"
#include "base/io/file.h"
#include "common/console.h"
#include "recon/hull/bounds_mask.h"
#include "recon/pipeline/frame_pipeline.h"
#include "recon/render/renderer.h"
#include "v3dctl/process.h"
#include "v3dctl/reconstruct/take_surfaces.h"

namespace v3d::ctl {
namespace {

namespace fs = std::filesystem;

// Compares the rendered silhouettes of the surface with the masks, within the view of the bounds.
class SilhouetteMeter {
 public:
  SilhouetteMeter(const Rig& rig, const Box& bounds) : views_(rig.size()) {
    for (const RigCamera& camera : rig) models_.push_back(camera.model);
    tbb::parallel_for(size_t{0}, rig.size(),
                      [&](size_t i) { views_[i] = bounds_mask(bounds, models_[i]); });
  }

  void measure(const Mesh& mesh, const std::vector<std::optional<SegmentedFrame>>& frames,
               ReconstructReport& report) const {
    const std::vector<Mask> rendered = draw_silhouettes(mesh, models_);
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

void add_stage_times(const StageTimes& times, double segment, ReconstructReport& report) {
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

void add_measurements(const Reconstruction& result, ReconstructReport& report) {
  ++report.frames;
  report.volume_m3.push_back(result.volume_m3);
  report.vertices.push_back(static_cast<double>(result.mesh.vertices.size()));
  report.triangles.push_back(static_cast<double>(result.mesh.triangles.size()));
  report.components.push_back(connected_components(result.mesh));
  report.ghosts.push_back(result.ghosts);
  report.bytes.push_back(static_cast<double>(result.compact.size()));
  report.quality.emplace_back(result.pulse, result.quality);
}

double peak_rss_mb() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) * 1024 / 1e6;
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
  Impl(const ReconstructRequest& complete, int threads, TakeFrames&& take)
      : take_(std::move(take)),
        options_(options_of(complete, threads)),
        reconstructor_(take_.rig(), options_),
        silhouettes_(tbb::task_arena(threads).execute(
            [&] { return SilhouetteMeter(take_.rig(), options_.bounds); })),
        repair_(complete.repair
                    ? std::optional<TakeSilhouetteRepair>(std::in_place, take_.rig(), options_)
                    : std::nullopt),
        surfaces_(take_, reconstructor_, repair_ ? &*repair_ : nullptr,
                  complete.smooth && options_.quality == Quality::kHigh) {}

  ReconstructReport make(std::span<const int64_t> pulses, PendingMeshFile& file,
                         const std::function<void()>& on_frame) {
    ReconstructReport report = empty_report(take_.rig(), options_, repair_.has_value());
    auto next = pulses.begin();
    reconstructor_.begin_sequence();
    FramePipeline<Job>(options_.threads,
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
    const Reconstruction& result = job.made.work.result;
    silhouettes_.measure(result.mesh, job.made.frames, report);
    add_stage_times(result.times, job.made.segment_ms, report);
    add_measurements(result, report);
    if (result.cameras.size() < take_.rig().size()) ++report.incomplete;
  }

  TakeFrames take_;
  const ReconstructOptions options_;
  Reconstructor reconstructor_;
  const SilhouetteMeter silhouettes_;
  std::optional<TakeSilhouetteRepair> repair_;
  TakeSurfaces surfaces_;
};

TakeReconstruction::TakeReconstruction(const ReconstructRequest& complete, int threads,
                                       TakeFrames take)
    : impl_(std::make_unique<Impl>(complete, threads, std::move(take))) {}
TakeReconstruction::~TakeReconstruction() = default;

ReconstructReport TakeReconstruction::make(std::span<const int64_t> pulses, PendingMeshFile& file,
                                           const std::function<void()>& on_frame) {
  return impl_->make(pulses, file, on_frame);
}

ReconstructReport reconstruct_take(const ReconstructRequest& request) {
  const MonotonicInstant begin = Monotonic::now();
  TakeFrames take = open_take(request);
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

}  // namespace v3d::ctl
