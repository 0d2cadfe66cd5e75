#include <algorithm>
#include <map>
#include <stdexcept>

#include "base/core/error.h"
#include "base/core/time.h"
#include "base/io/file.h"
#include "common/console.h"
#include "take/logs/mesh_file.h"
#include "v3dctl/reconstruct/take_reconstruction.h"
#include "v3dctl/reconstruct/task_runner.h"

namespace v3d::ctl {
namespace {

namespace fs = std::filesystem;

constexpr int kMaxTries = 3;

/// Last line of the newest task log, after its path; empty when no task wrote anything.
std::string last_log_line(const fs::path& folder) {
  fs::path newest;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
    const fs::path& path = entry.path();
    if (!path.filename().string().starts_with("task-") || fs::file_size(path) == 0) continue;
    if (newest.empty() || fs::last_write_time(path) > fs::last_write_time(newest)) newest = path;
  }
  if (newest.empty()) return {};
  std::string text = read_file(newest);
  text.erase(text.find_last_not_of('\n') + 1);
  return newest.string() + ": " + text.substr(text.rfind('\n') + 1);
}

// One run: starts tasks until all shards are finished, then joins them.
class ShardedRun {
 public:
  ShardedRun(const ReconstructRequest& request, int threads, const MakeTaskRunner& make_runner)
      : ShardedRun(request, threads, make_runner, open_take(request)) {}

  ReconstructReport run() {
    require_lock();
    folder_.remove_messages();
    find_shards();
    for (const auto& [number, report] : found_) report_.frames_kept += report.frames;
    if (!found_.empty()) {
      note(std::to_string(found_.size()) + " of " + count_of(std::ssize(shards_), "shard") +
           " kept from an earlier run");
    }
    try {
      make_missing();
    } catch (...) {
      if (folder_.saved().empty() && !names_log_) folder_.remove();
      throw;
    }
    join();
    folder_.remove();
    folder_.remove_others();
    return std::move(report_);
  }

 private:
  ShardedRun(const ReconstructRequest& request, int threads, const MakeTaskRunner& make_runner,
             const recorded::TakeFrames& take)
      : complete_(with_defaults(request, take)),
        shards_(shards_of(pulses_of(request, take))),
        paths_(take.paths()),
        empty_(empty_report(take.rig(), complete_, threads)),
        report_(empty_),
        folder_(ShardFolder::create(complete_, take)),
        lock_(folder_),
        tasks_(make_runner(folder_, complete_)),
        progress_("reconstruct", frames()) {
    report_.incomplete = pulses_without_frames(request, take);
  }

  /// Accepts a disk without locks: two runs in one folder would then do the same work twice.
  void require_lock() const {
    if (lock_.state() == ShardFolderLock::State::kHeldByAnother) {
      throw InputError(folder_.path().string() +
                       ": another v3dctl reconstruct already makes these shards");
    }
    if (!lock_.error().empty()) throw std::runtime_error(lock_.error());
  }

  void make_missing() {
    for (int tries = 0; !missing().empty(); ++tries) {
      if (tries == kMaxTries) fail();
      run_tasks();
      find_shards();
    }
  }

  int64_t frames() const {
    int64_t count = 0;
    for (const Shard& shard : shards_) count += std::ssize(shard.pulses);
    return count;
  }

  /// Reads the measurements of finished shards; damaged ones are made again.
  void find_shards() {
    const std::set<int64_t> saved = folder_.saved();
    for (const Shard& shard : shards_) {
      if (found_.contains(shard.number) || !saved.contains(shard.number)) continue;
      std::optional<ReconstructReport> report = folder_.find(shard, empty_);
      if (!report) continue;
      found_.emplace(shard.number, *std::move(report));
      frames_found_ += std::ssize(shard.pulses);
    }
    show(frames_found_);
  }

  /// Shows the progress by the frames of finished shards, including damaged ones.
  void show(int64_t frames) {
    if (frames > shown_) progress_.advance(frames - shown_);
    shown_ = std::max(shown_, frames);
  }

  /// Indices of unfinished shards.
  std::vector<int64_t> missing() const {
    std::vector<int64_t> indices;
    for (size_t n = 0; n < shards_.size(); ++n) {
      if (!found_.contains(shards_[n].number)) indices.push_back(static_cast<int64_t>(n));
    }
    return indices;
  }

  void run_tasks() {
    const std::vector<int64_t> indices = missing();
    // A damaged shard must not count as finished.
    for (const int64_t index : indices) folder_.drop(shards_[static_cast<size_t>(index)]);
    tasks_->start(indices, std::ssize(shards_));
    while (tasks_->poll()) {
      stop_on_error_or_interrupt();
      const std::set<int64_t> saved = folder_.saved();
      int64_t frames = 0, shards = 0;
      for (const Shard& shard : shards_) {
        if (!saved.contains(shard.number)) continue;
        frames += std::ssize(shard.pulses);
        ++shards;
      }
      show(frames);
      if (shards == std::ssize(shards_)) break;
    }
    stop_on_error_or_interrupt();
    tasks_->cancel();
  }

  void stop_on_error_or_interrupt() {
    const std::optional<std::string> error = folder_.saved_error();
    if (!error && !interrupted()) return;
    tasks_->cancel();
    if (error) throw InputError(*error);
    throw std::runtime_error(
        "interrupted; repeat the command to continue after the finished shards");
  }

  [[noreturn]] void fail() {
    throw std::runtime_error(count_of(std::ssize(missing()), "shard") + " of the take failed " +
                             std::to_string(kMaxTries) + " times; " + reason_of_failure());
  }

  /// A task that a signal ends may have no time for a message, so both are named.
  std::string reason_of_failure() {
    const std::string log_line = last_log_line(folder_.path());
    names_log_ = !log_line.empty();
    std::string reason = tasks_->failure();
    if (names_log_) reason += (reason.empty() ? "" : "; ") + log_line;
    return reason.empty() ? "no task wrote a message" + tasks_->hint() : reason;
  }

  void join() {
    PendingMeshes files(paths_.mesh(), proxy_path(complete_, paths_));
    for (const Shard& shard : shards_) {
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
  const std::vector<Shard> shards_;
  const take::TakePaths paths_;
  const ReconstructReport empty_;
  ReconstructReport report_;
  const ShardFolder folder_;
  const ShardFolderLock lock_;
  const std::unique_ptr<TaskRunner> tasks_;
  Progress progress_;
  std::map<int64_t, ReconstructReport> found_;  ///< by number
  int64_t frames_found_ = 0;
  int64_t shown_ = 0;
  bool names_log_ = false;  ///< the error does, so the log stays
};

}  // namespace

ReconstructReport reconstruct_sharded(const ReconstructRequest& request, int threads,
                                      const MakeTaskRunner& make_runner) {
  const MonotonicInstant begin = Monotonic::now();
  ReconstructReport report = ShardedRun(request, threads, make_runner).run();
  report.seconds = to_seconds(Monotonic::now() - begin);
  return report;
}

void reconstruct_shards(const ShardFolder& folder, take::FrameRange range, int threads) {
  try {
    const ReconstructRequest request = folder.request();
    recorded::TakeFrames take = open_take(request);
    const std::vector<Shard> shards = shards_of(pulses_of(request, take));
    const ReconstructReport empty = empty_report(take.rig(), request, threads);
    TakeReconstruction reconstruction(request, threads, std::move(take));
    for (size_t n = 0; n < shards.size(); ++n) {
      if (!range.contains(static_cast<int64_t>(n)) || folder.find(shards[n], empty)) continue;
      const Shard& shard = shards[n];
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
