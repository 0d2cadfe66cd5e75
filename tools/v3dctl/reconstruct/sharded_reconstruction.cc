#include "v3dctl/reconstruct/sharded_reconstruction.h"

#include <algorithm>
#include <map>
#include <stdexcept>

#include "base/error.h"
#include "base/file.h"
#include "base/time.h"
#include "common/console.h"
#include "take/mesh_file.h"
#include "v3dctl/process.h"
#include "v3dctl/reconstruct/pending_mesh_file.h"
#include "v3dctl/reconstruct/shard_folder.h"
#include "v3dctl/reconstruct/take_reconstruction.h"

namespace v3d::ctl {
namespace {

namespace fs = std::filesystem;

constexpr int kTries = 3;

/// The last line of the task log that was written last; empty where no task wrote anything.
std::string last_words(const fs::path& folder) {
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

// The pieces of a take until they are joined.
class SharedRun {
 public:
  SharedRun(const ReconstructRequest& request, int threads, const MakeTasks& make_tasks)
      : SharedRun(request, threads, make_tasks, open_take(request)) {}

  ReconstructReport all() {
    require_lock();
    folder_.forget_refusals();
    look();
    report_.frames_kept = frames_found_;
    if (!found_.empty()) {
      note(std::to_string(found_.size()) + " of " + count_of(std::ssize(pieces_), "piece") +
           " are there from an earlier run");
    }
    try {
      make_all();
    } catch (...) {
      if (folder_.saved().empty()) folder_.remove();
      throw;
    }
    join();
    folder_.remove();
    folder_.remove_others();
    return std::move(report_);
  }

 private:
  SharedRun(const ReconstructRequest& request, int threads, const MakeTasks& make_tasks,
            const TakeFrames& take)
      : settled_(settle(request, take)),
        pieces_(pieces_of(pulses_of(request, take))),
        mesh_(take.paths().mesh()),
        begun_(begin_report(take.rig(), options_of(settled_, threads), request.mend)),
        report_(begun_),
        folder_(PieceFolder::of(settled_, take)),
        lock_(folder_),
        tasks_(make_tasks(folder_, settled_)),
        progress_("reconstruct", frames()) {
    report_.incomplete = pulses_without_frames(request, take);
  }

  /// A disk without locks is accepted: two runs in one folder then do the same work twice.
  void require_lock() const {
    if (lock_.state() == PieceFolderLock::State::kHeldByAnother) {
      throw InputError(folder_.path().string() +
                       ": another v3dctl reconstruct waits for these pieces already");
    }
    if (!lock_.error().empty()) throw std::runtime_error(lock_.error());
  }

  void make_all() {
    for (int tries = 0; !missing().empty(); ++tries) {
      if (tries == kTries) fail();
      run_tasks();
      look();
    }
  }

  int64_t frames() const {
    int64_t count = 0;
    for (const Piece& piece : pieces_) count += std::ssize(piece.pulses);
    return count;
  }

  /// Believes the finished pieces that are whole.
  void look() {
    const std::set<int64_t> saved = folder_.saved();
    for (const Piece& piece : pieces_) {
      if (found_.contains(piece.number) || !saved.contains(piece.number)) continue;
      std::optional<ReconstructReport> report = folder_.find(piece, begun_);
      if (!report) continue;
      found_.emplace(piece.number, *std::move(report));
      frames_found_ += std::ssize(piece.pulses);
    }
    show(frames_found_);
  }

  /// How many frames the folder seems to have; a piece that is damaged counts until it is looked
  /// at.
  void show(int64_t frames) {
    if (frames > shown_) progress_.advance(frames - shown_);
    shown_ = std::max(shown_, frames);
  }

  /// Places in the list of pieces.
  std::vector<int64_t> missing() const {
    std::vector<int64_t> places;
    for (size_t n = 0; n < pieces_.size(); ++n) {
      if (!found_.contains(pieces_[n].number)) places.push_back(static_cast<int64_t>(n));
    }
    return places;
  }

  void run_tasks() {
    const std::vector<int64_t> places = missing();
    // One that is there and not whole must not be mistaken for finished.
    for (const int64_t place : places) folder_.drop(pieces_[static_cast<size_t>(place)]);
    tasks_->start(places, std::ssize(pieces_));
    while (tasks_->runs()) {
      stop_if_asked();
      const std::set<int64_t> saved = folder_.saved();
      int64_t frames = 0, pieces = 0;
      for (const Piece& piece : pieces_) {
        if (!saved.contains(piece.number)) continue;
        frames += std::ssize(piece.pulses);
        ++pieces;
      }
      show(frames);
      if (pieces == std::ssize(pieces_)) break;
    }
    stop_if_asked();
    tasks_->cancel();
  }

  void stop_if_asked() {
    const std::optional<std::string> refusal = folder_.refusal();
    if (!refusal && !interrupted()) return;
    tasks_->cancel();
    if (refusal) throw InputError(*refusal);
    throw std::runtime_error(
        "interrupted; the same command goes on behind the pieces that are "
        "finished");
  }

  [[noreturn]] void fail() const {
    const std::string words = last_words(folder_.path());
    const std::string hint = tasks_->hint();
    throw std::runtime_error(count_of(std::ssize(missing()), "piece") + " of the take failed " +
                             std::to_string(kTries) + " times; " +
                             (words.empty() ? "no task left a word" + hint : words));
  }

  void join() {
    PendingMeshFile file(mesh_);
    for (const Piece& piece : pieces_) {
      MeshFileReader meshes(folder_.mesh(piece));
      for (const int64_t pulse : piece.pulses) {
        const auto compact = meshes.read(pulse);
        if (!compact) throw std::runtime_error(folder_.mesh(piece).string() + ": has changed");
        file.append(pulse, *compact);
      }
      append(report_, found_.at(piece.number));
    }
    file.finish();
  }

  const ReconstructRequest settled_;
  const std::vector<Piece> pieces_;
  const fs::path mesh_;
  const ReconstructReport begun_;
  ReconstructReport report_;
  const PieceFolder folder_;
  const PieceFolderLock lock_;
  const std::unique_ptr<TaskRunner> tasks_;
  Progress progress_;
  std::map<int64_t, ReconstructReport> found_;  ///< by number
  int64_t frames_found_ = 0;
  int64_t shown_ = 0;
};

}  // namespace

ReconstructReport reconstruct_shared(const ReconstructRequest& request, int threads,
                                     const MakeTasks& make_tasks) {
  const MonotonicInstant begin = Monotonic::now();
  ReconstructReport report = SharedRun(request, threads, make_tasks).all();
  report.seconds = to_seconds(Monotonic::now() - begin);
  return report;
}

void reconstruct_pieces(const PieceFolder& folder, FrameRange range, int threads) {
  try {
    const ReconstructRequest request = folder.order();
    TakeFrames take = open_take(request);
    const std::vector<Piece> pieces = pieces_of(pulses_of(request, take));
    const ReconstructReport begun =
        begin_report(take.rig(), options_of(request, threads), request.mend);
    TakeReconstruction reconstruction(request, threads, std::move(take));
    for (size_t n = 0; n < pieces.size(); ++n) {
      if (!range.contains(static_cast<int64_t>(n)) || folder.find(pieces[n], begun)) continue;
      PendingMeshFile file(folder.mesh(pieces[n]));
      const ReconstructReport report = reconstruction.make(pieces[n].pulses, file, [] {});
      file.finish();
      folder.save(pieces[n], report);
    }
  } catch (const InputError& error) {
    folder.refuse(error.what());
    throw;
  }
}

}  // namespace v3d::ctl
