#include "v3dctl/reconstruct/sharded_reconstruction.h"

#include <algorithm>
#include <map>
#include <optional>
#include <set>
#include <stdexcept>
#include <utility>
#include <vector>

#include "base/core/error.h"
#include "base/core/time.h"
#include "common/console.h"
#include "take/logs/mesh_file.h"
#include "v3dctl/reconstruct/sharded_work.h"
#include "v3dctl/reconstruct/take_reconstruction.h"

namespace v3d::ctl {
namespace {

namespace fs = std::filesystem;

// One run: starts tasks until all shards are finished, then joins them.
class ShardedReconstruction : public ShardedWork {
 public:
  ShardedReconstruction(const ReconstructRequest& request, int threads,
                        const MakeTaskRunner& make_runner)
      : ShardedReconstruction(request, threads, make_runner, open_take(request)) {}

  ReconstructReport run() {
    ShardedRun run(folder_, *tasks_, "reconstruct");
    folder_.remove_messages();
    find_finished();
    for (const auto& [number, report] : found_) report_.frames_kept += report.frames;
    if (!found_.empty()) {
      note(std::to_string(found_.size()) + " of " + count_of(std::ssize(shards_), "shard") +
           " kept from an earlier run");
    }
    run.make(*this);
    join();
    folder_.remove();
    folder_.remove_others();
    return std::move(report_);
  }

  void find_finished() override {
    const std::set<int64_t> saved = folder_.saved();
    for (const TakeShard& shard : shards_) {
      if (found_.contains(shard.number) || !saved.contains(shard.number)) continue;
      std::optional<ReconstructReport> report = folder_.find(shard, empty_);
      if (!report) continue;
      found_.emplace(shard.number, *std::move(report));
      frames_found_ += std::ssize(shard.pulses);
    }
    show(frames_found_);
  }

  std::vector<take::FrameRange> missing() const override {
    std::vector<take::FrameRange> indices;
    for (size_t n = 0; n < shards_.size(); ++n) {
      const auto index = static_cast<int64_t>(n);
      if (!found_.contains(shards_[n].number)) indices.push_back({index, index + 1});
    }
    return indices;
  }

  void start(const std::vector<take::FrameRange>& shards, TaskRunner& tasks) override {
    std::vector<int64_t> indices;
    for (const take::FrameRange& shard : shards) {
      // A damaged shard must not count as finished.
      folder_.drop(shards_[static_cast<size_t>(shard.begin)]);
      indices.push_back(shard.begin);
    }
    tasks.start(indices, std::ssize(shards_));
  }

  bool watch() override {
    const std::set<int64_t> saved = folder_.saved();
    int64_t frames = 0, shards = 0;
    for (const TakeShard& shard : shards_) {
      if (!saved.contains(shard.number)) continue;
      frames += std::ssize(shard.pulses);
      ++shards;
    }
    show(frames);
    return shards < std::ssize(shards_);
  }

 private:
  ShardedReconstruction(const ReconstructRequest& request, int threads,
                        const MakeTaskRunner& make_runner, const recorded::TakeFrames& take)
      : complete_(with_defaults(request, take)),
        shards_(shards_of(pulses_of(request, take))),
        paths_(take.paths()),
        empty_(empty_report(take.rig(), complete_, threads)),
        report_(empty_),
        folder_(ShardFolder::create(complete_, take)),
        tasks_(make_runner(folder_, complete_)),
        progress_("reconstruct", frames()) {
    report_.incomplete = pulses_without_frames(request, take);
  }

  int64_t frames() const {
    int64_t count = 0;
    for (const TakeShard& shard : shards_) count += std::ssize(shard.pulses);
    return count;
  }

  /// Shows the progress by the frames of finished shards, including damaged ones.
  void show(int64_t frames) {
    if (frames > shown_) progress_.advance(frames - shown_);
    shown_ = std::max(shown_, frames);
  }

  void join() {
    PendingMeshes files(paths_.mesh(), proxy_path(complete_, paths_));
    for (const TakeShard& shard : shards_) {
      const ReconstructReport& made = found_.at(shard.number);
      const std::vector<int64_t> pulses = pulses_with_meshes(shard, made);
      append_meshes(pulses, folder_.mesh(shard), files.master);
      if (files.proxy) append_meshes(pulses, folder_.proxy(shard), *files.proxy);
      append(report_, made);
    }
    replace_meshes(files, paths_);
  }

  /// Appends the meshes of `path`, a file of a shard.
  static void append_meshes(const std::vector<int64_t>& pulses, const fs::path& path,
                            PendingMeshFile& file) {
    take::MeshFileReader meshes(path);
    for (const int64_t pulse : pulses) {
      const auto compact = meshes.read(pulse);
      if (!compact) throw std::runtime_error(compact.error().message);
      if (!*compact) throw std::runtime_error(path.string() + ": has changed");
      file.append(pulse, **compact);
    }
  }

  const ReconstructRequest complete_;
  const std::vector<TakeShard> shards_;
  const take::TakePaths paths_;
  const ReconstructReport empty_;
  ReconstructReport report_;
  const ShardFolder folder_;
  const std::unique_ptr<TaskRunner> tasks_;
  Progress progress_;
  std::map<int64_t, ReconstructReport> found_;  ///< by number
  int64_t frames_found_ = 0;
  int64_t shown_ = 0;
};

}  // namespace

ReconstructReport reconstruct_sharded(const ReconstructRequest& request, int threads,
                                      const MakeTaskRunner& make_runner) {
  const MonotonicInstant begin = Monotonic::now();
  ReconstructReport report = ShardedReconstruction(request, threads, make_runner).run();
  report.seconds = to_seconds(Monotonic::now() - begin);
  return report;
}

void reconstruct_shards(const ShardFolder& folder, take::FrameRange range, int threads) {
  try {
    const ReconstructRequest request = folder.request();
    recorded::TakeFrames take = open_take(request);
    const std::vector<TakeShard> shards = shards_of(pulses_of(request, take));
    const ReconstructReport empty = empty_report(take.rig(), request, threads);
    TakeReconstruction reconstruction(request, threads, std::move(take));
    for (size_t n = 0; n < shards.size(); ++n) {
      if (!range.contains(static_cast<int64_t>(n)) || folder.find(shards[n], empty)) continue;
      const TakeShard& shard = shards[n];
      const bool with_proxy = request.proxy_voxel_m.has_value();
      PendingMeshes files(folder.mesh(shard),
                          with_proxy ? std::optional(folder.proxy(shard)) : std::nullopt);
      const ReconstructReport report = reconstruction.make(shard.pulses, files, [] {});
      if (n == 0) require_meshes(report);
      files.finish();
      folder.save(shard, report);
    }
  } catch (const InputError& error) {
    folder.save_error(error.what());
    throw;
  }
}

}  // namespace v3d::ctl
