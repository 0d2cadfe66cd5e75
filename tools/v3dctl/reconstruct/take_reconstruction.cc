#include "v3dctl/reconstruct/take_reconstruction.h"

#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <optional>
#include <string>
#include <utility>

#include "base/core/error.h"
#include "base/core/time.h"
#include "base/geometry/rigid_transform.h"
#include "base/image/mask_operations.h"
#include "common/console.h"
#include "recon/hull/voxel_grid.h"
#include "recon/pipeline/frame_pipeline.h"
#include "recon/render/renderer.h"
#include "v3dctl/reconstruct/shard_folder.h"
#include "v3dctl/reconstruct/take_surfaces.h"

namespace v3d::ctl {
namespace {

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
  report.frame_quality.emplace_back(result.pulse, result.quality);
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

/// Surfaces with the voxels of the proxy, from the input of the master.
class ProxySurfaces {
 public:
  /// `master` is borrowed. Requires a request with a proxy.
  ProxySurfaces(const recorded::TakeFrames& take, const TakeSurfaces& master,
                const ReconstructRequest& complete, int threads)
      : master_(master),
        options_(options_of(proxy_request(complete), threads)),
        reconstructor_(take.rig(), options_),
        surfaces_(
            reconstructor_, take.pulses(), [this](int64_t pulse) { return input(pulse); },
            complete.smooth && options_.quality == Quality::kHigh) {}

  /// Encodes the next surface as a key frame.
  void begin_sequence() { reconstructor_.begin_sequence(); }

  /// The coloured surface of `pulse`. `made`: the result of the master's last make().
  TakeSurface make(int64_t pulse, const recon::FrameSetJob& made) {
    made_ = &made;
    TakeSurface surface = surfaces_.make(pulse);
    reconstructor_.make_colours(surface.work);
    return surface;
  }

  void encode(recon::FrameSetJob& work) { reconstructor_.encode(work); }

 private:
  /// The master has the same window or a larger one.
  TakeSurface input(int64_t pulse) const {
    const recon::FrameSetJob* const read =
        pulse == made_->set.pulse ? made_ : master_.input_in_window(pulse);
    V3D_CHECK(read != nullptr);
    return copy_of_input(*read);
  }

  const TakeSurfaces& master_;
  const recon::ReconstructOptions options_;
  recon::Reconstructor reconstructor_;
  TakeSurfaces surfaces_;
  const recon::FrameSetJob* made_ = nullptr;
};

}  // namespace

// Stages of the live reconstruction, preceded by reading and segmentation and followed by
// measuring.
class TakeReconstruction::Impl {
 public:
  Impl(const ReconstructRequest& complete, int threads, recorded::TakeFrames&& take)
      : take_(std::move(take)),
        options_(options_of(complete, threads)),
        empty_(empty_report(take_.rig(), complete, threads)),
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
        input_(take_, passes_, repair_ ? &*repair_ : nullptr,
               live_repair_ ? &*live_repair_ : nullptr),
        surfaces_(
            reconstructor_, take_.pulses(), [this](int64_t pulse) { return input_.read(pulse); },
            complete.smooth && options_.quality == Quality::kHigh) {
    if (complete.proxy_voxel_m) proxy_.emplace(take_, surfaces_, complete, threads);
  }

  ReconstructReport make(std::span<const int64_t> pulses, PendingMeshes& files,
                         const std::function<void()>& on_frame) {
    ReconstructReport report = empty_;
    auto next = pulses.begin();
    begin_sequence();
    recon::FramePipeline<Job>(
        options_.threads,
        [&]() -> std::optional<Job> {
          stop_if_interrupted();
          if (next == pulses.end()) return std::nullopt;
          return Job{*next++};
        },
        {[&](Job& job) { make_mesh(job); }, [&](Job& job) { encode(job, files); },
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
    TakeSurface proxy{};
    std::string oversized{};  ///< why the pulse gets no mesh; empty: it gets one
  };

  void begin_sequence() {
    reconstructor_.begin_sequence();
    if (proxy_) proxy_->begin_sequence();
  }

  void make_mesh(Job& job) {
    job.made = surfaces_.make(job.pulse);
    reconstructor_.make_colours(job.made.work);
    if (proxy_) job.proxy = proxy_->make(job.pulse, job.made.work);
  }

  /// Appends the pulse to both files or to none, because a proxy has the pulses of its master.
  void encode(Job& job, PendingMeshes& files) {
    try {
      reconstructor_.encode(job.made.work);
      if (proxy_) proxy_->encode(job.proxy.work);
    } catch (const recon::OversizedSurface& error) {
      job.oversized = error.what();
      begin_sequence();  // no frame may refer to one that is in no file
      return;
    }
    files.master.append(job.pulse, job.made.work.result.compact);
    if (proxy_) files.proxy->append(job.pulse, job.proxy.work.result.compact);
  }

  void measure(const Job& job, ReconstructReport& report) const {
    if (!job.oversized.empty()) {
      report.oversized.emplace_back(job.pulse, job.oversized);
      return;
    }
    measure(job.made, job.made.frames, report);
    if (job.made.lacks_camera) ++report.incomplete;
    if (proxy_) measure(job.proxy, job.made.frames, report.proxy.front());
  }

  void measure(const TakeSurface& made, const SegmentedFrames& frames,
               ReconstructReport& report) const {
    const recon::Reconstruction& result = made.work.result;
    silhouettes_.measure(result.mesh, frames, report);
    add_stage_times(result.times, made.segment_ms, report);
    add_measurements(result, report);
  }

  recorded::TakeFrames take_;
  const recon::ReconstructOptions options_;
  const ReconstructReport empty_;
  recon::Reconstructor reconstructor_;
  const SilhouetteMeter silhouettes_;
  std::optional<TakeSilhouetteRepair> repair_;
  std::optional<LivePulseRepair> live_repair_;
  const std::map<int64_t, int> passes_;
  TakeInput input_;
  TakeSurfaces surfaces_;
  std::optional<ProxySurfaces> proxy_;
};

TakeReconstruction::TakeReconstruction(const ReconstructRequest& complete, int threads,
                                       recorded::TakeFrames take)
    : impl_(std::make_unique<Impl>(complete, threads, std::move(take))) {}
TakeReconstruction::~TakeReconstruction() = default;

ReconstructReport TakeReconstruction::make(std::span<const int64_t> pulses, PendingMeshes& files,
                                           const std::function<void()>& on_frame) {
  return impl_->make(pulses, files, on_frame);
}

ReconstructReport reconstruct_take(const ReconstructRequest& request) {
  const MonotonicInstant begin = Monotonic::now();
  recorded::TakeFrames take = open_take(request);
  const std::vector<int64_t> pulses = pulses_of(request, take);
  const int64_t without_frames = pulses_without_frames(request, take);
  const take::TakePaths paths = take.paths();
  const ReconstructRequest complete = with_defaults(request, take);
  TakeReconstruction reconstruction(complete, threads_of(request), std::move(take));
  PendingMeshes files(paths.mesh(), proxy_path(complete, paths));
  Progress progress("reconstruct", std::ssize(pulses));
  const auto advance = [&] { progress.advance(); };
  const size_t first = shards_of(pulses)[0].pulses.size();
  ReconstructReport report = reconstruction.make(std::span(pulses).first(first), files, advance);
  require_meshes(report);
  append(report, reconstruction.make(std::span(pulses).subspan(first), files, advance));
  replace_meshes(files, paths);
  report.incomplete += without_frames;
  report.seconds = to_seconds(Monotonic::now() - begin);
  return report;
}

}  // namespace v3d::ctl
