#include "take/ledger/verify.h"

#include <algorithm>
#include <cerrno>
#include <iterator>
#include <utility>

#include "base/core/error.h"
#include "base/core/text.h"
#include "base/io/file.h"
#include "take/ledger/file_check.h"
#include "take/ledger/ledger.h"
#include "take/ledger/sound_mapping.h"
#include "take/ledger/take_account.h"
#include "take/logs/event_log.h"
#include "take/logs/frame_log.h"
#include "take/logs/log_files.h"
#include "take/logs/mesh_file.h"
#include "take/take_files.h"
#include "take/take_removal.h"

namespace v3d::take {
namespace {

/// What is read of each frame: the whole frame, or its label only.
enum class Depth : uint8_t { kFrames, kLabels };

/// The label of a frame. Empty when the frame belongs to another camera, or the part that was read
/// is damaged.
io::Result<std::optional<FrameLabel>> read_label(const EventLogReader& log, const EventSpan& event,
                                                 const std::string& camera, Depth depth) {
  const auto head = read_head(log, event);
  if (!head) return tl::make_unexpected(head.error());
  if (!*head || (*head)->camera != camera) return std::nullopt;
  if (depth == Depth::kLabels) return (*head)->label;
  const auto message = read_message<wire::FrameMessage>(log, event);
  if (!message) return tl::make_unexpected(message.error());
  return *message ? std::optional((*message)->frame.label) : std::nullopt;
}

/// The frames of one camera.
struct CountedCamera {
  std::string name;
  CameraAccount account{};
  ExposureCount exposures{};
  int64_t last_labelled = -1;  ///< highest pulse of a frame that is not suspect

  void add(const FrameLabel& label) {
    account.add(label.pulse, label.suspect);
    exposures.add(label.camera_counter);
    if (!label.suspect && label.pulse < kMaxPulses) {
      last_labelled = std::max(last_labelled, label.pulse);
    }
  }
};

/// Whether the ledger of a closed take is compared with the files.
enum class LedgerUse : uint8_t { kCompare, kIgnore };

class Verifier {
 public:
  Verifier(const TakePaths& paths, Depth depth, ReadFrom from,
           LedgerUse ledger_use = LedgerUse::kCompare, ReadProgress progress = {})
      : paths_(paths),
        depth_(depth),
        from_(from),
        ledger_use_(ledger_use),
        progress_(std::move(progress)) {
    result_.info = load_take_info(paths);
  }

  /// Call once.
  Verification run() {
    stored_ = stored_ledger();
    const std::optional<Ledger>& stored = stored_;
    FileCheck files(paths_, stored ? &*stored : nullptr, from_, result_);
    // Each log is read for its checksum, then event by event from the page cache.
    const bool reads_files =
        depth_ == Depth::kFrames && result_.info.state != TakeState::kRecording;
    std::vector<CountedCamera> cameras;
    for (const std::string& camera : result_.info.cameras) {
      if (reads_files) files.read_log(paths_.frames(camera));
      cameras.push_back(count_frames(camera));
    }
    if (reads_files) files.read_log(paths_.pulses());
    count_pulses(stored, cameras);
    for (const CountedCamera& camera : cameras) {
      CameraLedger counted = camera.account.ledger(camera.name, result_.ledger.commanded);
      counted.exposed = camera.exposures.exposed();
      if (stored) compare(*stored, counted);
      result_.ledger.cameras.push_back(std::move(counted));
    }
    count_sounds(stored);
    check_calib();
    if (reads_files) files.finish();
    if (depth_ == Depth::kFrames) check_meshes();  // gigabytes, which no ledger counts
    if (stored && stored->files.empty() && reads_files) {
      result_.notes.push_back(
          "ledger.toml: has no checksums of files (written by an older version): frames were "
          "compared with their own checksums; calibration, plates and pulses were not compared");
    }
    return std::move(result_);
  }

  /// After run(): the ledger that was compared; empty when the take was not closed, and when its
  /// ledger cannot be read.
  const std::optional<Ledger>& stored() const { return stored_; }

 private:
  void disagree(const std::filesystem::path& file, const std::string& what) {
    result_.disagreements.push_back(file.filename().string() + ": " + what);
  }

  std::optional<Ledger> stored_ledger() {
    try {
      Ledger stored = load_ledger(paths_.ledger());
      // A daemon may have continued the take after an earlier recovery. The ledger of that recovery
      // is then older than the logs.
      const bool is_open = result_.info.state == TakeState::kRecording;
      if (is_open || ledger_use_ == LedgerUse::kIgnore) return std::nullopt;
      return stored;
    } catch (const InputError& error) {
      result_.disagreements.emplace_back(error.what());
      return std::nullopt;
    }
  }

  void count_pulses(const std::optional<Ledger>& stored,
                    const std::vector<CountedCamera>& cameras) {
    Ledger& ledger = result_.ledger;
    ledger.take = result_.info.name;
    PulseEvidence evidence{.sensed = {},
                           .has_sense_line = has_sense_line(),
                           .known = result_.info.pulses,
                           .is_closed = result_.info.state == TakeState::kComplete};
    for (const CountedCamera& camera : cameras) {
      evidence.last_labelled = std::max(evidence.last_labelled, camera.last_labelled);
    }
    PulseSet& sensed = evidence.sensed;
    try {
      const EventLogReader log(paths_.pulses());
      note_unused_indexes(log);
      for (const wire::PulseMessage& message : read_pulses(log)) {
        if (message.pulse < kMaxPulses) {
          sensed.insert(message.pulse);
        } else {
          disagree(paths_.pulses(), "holds pulse " + format_count(message.pulse) +
                                        "; expected less than " + format_count(kMaxPulses));
        }
      }
    } catch (const InputError& error) {
      report(error.what(), is_absent_log(paths_.pulses()));
    }
    recount_pulses(evidence, stored, ledger);
    if (stored && stored->sensed && *stored->sensed != sensed.size()) {
      disagree(paths_.pulses(), "holds " + format_count(sensed.size()) +
                                    " pulses, the ledger says " + format_count(*stored->sensed));
    }
    if (result_.info.state == TakeState::kComplete && result_.info.pulses != ledger.commanded) {
      disagree(paths_.info(), "says " + format_count(result_.info.pulses) +
                                  " pulses, the ledger says " + format_count(ledger.commanded));
    }
  }

  void note_unused_indexes(const EventLogReader& log) {
    for (const LogSegment& segment : log.segments()) {
      if (segment.index_error.empty()) continue;
      result_.notes.push_back(segment.index_error + "; the whole segment was searched for events");
    }
  }

  /// Adds a line of an unreadable file; it is a read error unless the file does not exist.
  void report(const std::string& line, bool is_absent) {
    result_.disagreements.push_back(line);
    if (!is_absent) result_.read_errors.push_back(line);
  }

  /// By the studio file of the take; true where it has none.
  bool has_sense_line() {
    try {
      const std::optional<Studio> studio = load_take_studio(paths_);
      return !studio || studio->trigger.is_sensed();
    } catch (const InputError&) {  // reported as a damaged file of the take
      return true;
    }
  }

  CountedCamera count_frames(const std::string& camera) {
    CountedCamera counted{.name = camera};
    if (const auto log = EventLogReader::open(paths_.frames(camera), progress_)) {
      note_unused_indexes(*log);
      count_events(*log, counted);
    } else {
      report(log.error().message, is_absent_log(paths_.frames(camera)));
    }
    return counted;
  }

  void count_events(const EventLogReader& log, CountedCamera& counted) {
    const std::string& camera = counted.name;
    const std::filesystem::path file = paths_.frames(camera);
    int64_t damaged = log.damaged_places(), unreadable = 0;
    std::vector<std::string> errors = log.read_errors();
    for (const EventSpan& event : log.events()) {
      const auto label = read_label(log, event, camera, depth_);
      if (progress_) progress_();
      if (!label) {
        ++unreadable;
        if (errors.empty()) errors.push_back(label.error().message);
      } else if (!*label) {
        ++damaged;
      } else {
        counted.add(**label);
      }
    }
    for (const std::string& error : errors) report(error, false);
    if (unreadable > 0) disagree(file, format_count(unreadable) + " events cannot be read");
    if (damaged > 0) disagree(file, format_count(damaged) + " damaged events");
    if (log.torn_bytes() > 0) {
      disagree(file, "ends in an unfinished event of " + format_count(log.torn_bytes()) +
                         " bytes, which is ignored");
    }
  }

  void compare(const Ledger& stored, CameraLedger& counted) {
    const auto found = std::find_if(stored.cameras.begin(), stored.cameras.end(),
                                    [&](const CameraLedger& c) { return c.name == counted.name; });
    if (found == stored.cameras.end()) {
      disagree(paths_.ledger(), "has no camera '" + counted.name + "'");
      return;
    }
    counted.exposed = found->exposed;
    counted.received = found->received;
    counted.published = found->published;
    if (found->written != counted.written) {
      disagree(paths_.frames(counted.name), "holds " + format_count(counted.written) +
                                                " frames, the ledger says " +
                                                format_count(found->written));
    } else if (found->missing != counted.missing || found->duplicate != counted.duplicate ||
               !std::ranges::includes(found->suspect, counted.suspect)) {
      disagree(paths_.frames(counted.name),
               "its missing, duplicate or suspect pulses are not those of the ledger");
    } else {
      // In a collected take, a frame may be suspect only because its node did not know of its
      // pulse: it left the take, or crashed before it wrote the pulse.
      counted.suspect = found->suspect;
    }
  }

  /// Compares the sound files with the ledger; without a ledger, counts their samples.
  void count_sounds(const std::optional<Ledger>& stored) {
    const auto counted = read_sounds(paths_);
    if (!counted) return report(counted.error().message, false);
    for (const std::string& problem : counted->problems) result_.disagreements.push_back(problem);
    result_.ledger.sounds = stored ? stored->sounds : counted->sounds;
    if (stored) compare_sounds(*stored, counted->sounds);
    if (counted->problems.empty()) find_nodes_without_sound(counted->sounds);
  }

  void compare_sounds(const Ledger& stored, const std::vector<SoundLedger>& counted) {
    for (const SoundLedger& listed : stored.sounds) {
      const auto found = std::ranges::find(counted, listed.file, &SoundLedger::file);
      if (found == counted.end()) continue;  // unreadable, or reported as a missing file
      if (found->samples != listed.samples || found->rate_hz != listed.rate_hz ||
          found->channels != listed.channels) {
        result_.disagreements.push_back(listed.file + ": holds " + contents_of(*found) +
                                        ", the ledger says " + contents_of(listed));
      }
    }
  }

  /// A device that delivered nothing during a whole take has no file and no table in the ledger.
  void find_nodes_without_sound(const std::vector<SoundLedger>& counted) {
    Ledger& ledger = result_.ledger;
    if (ledger.commanded == 0) return;
    try {
      const std::optional<Studio> studio = load_take_studio(paths_);
      if (!studio) return;
      for (const StudioSound& sound : studio->sounds) {
        const auto is_of_node = [&](const SoundLedger& file) { return file.node == sound.node; };
        const bool has_sound = std::ranges::any_of(ledger.sounds, is_of_node) ||
                               std::ranges::any_of(counted, is_of_node);
        if (!has_sound && is_in_folder(sound.node, *studio)) {
          ledger.nodes_without_sound.push_back(sound.node);
        }
      }
    } catch (const InputError&) {  // reported as a damaged file of the take
    }
  }

  /// The folder may have the part of one node. It has that of `node` if it has one of its cameras
  /// or, without any camera, if the node is that of the trigger.
  bool is_in_folder(const std::string& node, const Studio& studio) const {
    const std::vector<std::string>& cameras = result_.info.cameras;
    if (cameras.empty()) return node == studio.trigger.node;
    return std::ranges::any_of(studio.cameras_of(node), [&](const StudioCamera& camera) {
      return std::ranges::find(cameras, camera.name) != cameras.end();
    });
  }

  void check_calib() {
    if (!file_exists(paths_.calib())) disagree(paths_.calib(), "missing");
  }

  /// Reconstruction is optional, and so is a proxy.
  void check_meshes() {
    const auto meshes = check_mesh_file(paths_.mesh()), proxies = check_mesh_file(paths_.proxy());
    if (!file_exists(paths_.proxy())) return;
    if (!file_exists(paths_.mesh())) {
      disagree(paths_.proxy(),
               "is the proxy of a missing mesh.v3d; expected both, as v3dctl "
               "reconstruct --proxy makes them");
    } else if (meshes && proxies && *meshes != *proxies) {
      disagree(paths_.proxy(),
               "has other pulses than mesh.v3d; expected those of one v3dctl "
               "reconstruct --proxy");
    }
  }

  /// Pulses of the file; empty when it is absent or is not a mesh file.
  std::optional<std::vector<int64_t>> check_mesh_file(const std::filesystem::path& path) {
    if (!file_exists(path)) return std::nullopt;
    try {
      MeshFileReader meshes(path);
      read_meshes(meshes, path);
      if (meshes.index_was_rebuilt() && result_.info.state != TakeState::kRecording) {
        disagree(path, "ends without its index: truncated, or not finished; " +
                           format_count(std::ssize(meshes.pulses())) + " meshes can be read");
      }
      return meshes.pulses();
    } catch (const InputError& error) {
      result_.disagreements.emplace_back(error.what());
      return std::nullopt;
    }
  }

  /// Reads every mesh. A read error is no error of the ledger, which does not count meshes.
  void read_meshes(MeshFileReader& meshes, const std::filesystem::path& path) {
    int64_t damaged = 0, unreadable = 0;
    for (const int64_t pulse : meshes.pulses()) {
      const auto mesh = meshes.read(pulse);
      if (mesh && !*mesh) ++damaged;
      if (!mesh && ++unreadable == 1) result_.disagreements.push_back(mesh.error().message);
    }
    if (unreadable > 0) disagree(path, format_count(unreadable) + " meshes cannot be read");
    if (damaged > 0) disagree(path, format_count(damaged) + " damaged meshes");
  }

  const TakePaths paths_;
  const Depth depth_;
  const ReadFrom from_;
  const LedgerUse ledger_use_;
  const ReadProgress progress_;
  std::optional<Ledger> stored_;
  Verification result_;
};

/// True when the logs hold more frames of a camera, or more pulses, than the ledger of a recovery:
/// the disk gives more than it did then.
bool has_more_than(const Ledger& stored, const Ledger& counted) {
  const auto has_more_frames = [&](const CameraLedger& camera) {
    const auto found = std::ranges::find(stored.cameras, camera.name, &CameraLedger::name);
    return found == stored.cameras.end() || camera.written > found->written;
  };
  return counted.sensed > stored.sensed || std::ranges::any_of(counted.cameras, has_more_frames);
}

/// The result of counting a take by the labels of its frames.
struct Count {
  Verification result;
  bool keeps_ledger = false;  ///< the take was closed, and its ledger can be read
};

/// The ledger of a closed take could not be used. Throws std::runtime_error when it must not be
/// replaced: it cannot be read now, or it is as it was written, by another version.
void require_damaged_ledger(const TakePaths& paths) {
  if (!file_exists(paths.ledger())) return;
  const auto text = io::read_file(paths.ledger(), kMaxLedgerBytes, io::OpenMode::kReadWithinFolder);
  if (!text) {
    throw std::runtime_error(text.error().message + "; the take is closed, and its ledger is kept");
  }
  if (has_right_checksum(*text)) {
    throw std::runtime_error(paths.ledger().string() +
                             ": has unknown contents, but the right checksum: another version of "
                             "V3D wrote it, and can recover the take; it is kept");
  }
}

/// A closed take keeps its ledger, because new checksums would hide what has changed on the disk
/// since. Exception: a recovered take whose logs hold more than its ledger is counted again. Its
/// new ledger keeps the old entries of all files but the logs.
Count count_for_recovery(const TakePaths& paths, const ReadProgress& progress) {
  Verifier verifier(paths, Depth::kLabels, ReadFrom::kPageCache, LedgerUse::kCompare, progress);
  Count count{.result = verifier.run()};
  const std::optional<Ledger>& stored = verifier.stored();
  count.keeps_ledger = stored.has_value();
  if (!stored && count.result.info.state != TakeState::kRecording) require_damaged_ledger(paths);
  const bool counts_again = stored && count.result.info.state == TakeState::kRecovered &&
                            has_more_than(*stored, count.result.ledger);
  if (!counts_again) return count;
  Verifier again(paths, Depth::kLabels, ReadFrom::kPageCache, LedgerUse::kIgnore, progress);
  count = {.result = again.run()};
  for (const TakeFile& file : stored->files) {
    if (!file.name.ends_with(".lcmlog")) count.result.ledger.files.push_back(file);
  }
  count.result.ledger.absent_nodes = stored->absent_nodes;
  return count;
}

}  // namespace

void recount_pulses(const PulseEvidence& evidence, const std::optional<Ledger>& stored,
                    Ledger& ledger) {
  const PulseSet& sensed = evidence.sensed;
  const bool has_sense_line = stored ? stored->sensed.has_value() : evidence.has_sense_line;
  const int64_t last = has_sense_line ? sensed.last() : evidence.last_labelled;
  if (has_sense_line) ledger.sensed = sensed.size();
  ledger.commanded = stored ? stored->commanded : std::max(evidence.known, last + 1);
  ledger.commanded_is_minimum = stored ? stored->commanded_is_minimum : !evidence.is_closed;
  if (has_sense_line) ledger.unsensed = sensed.missing(ledger.commanded);
  if (!stored) return;
  ledger.absent_nodes = stored->absent_nodes;
  ledger.extra = stored->extra;  // not in the log
  ledger.runt = stored->runt;
}

Verification verify_take(const TakePaths& paths, ReadFrom from) {
  return Verifier(paths, Depth::kFrames, from).run();
}

Verification recover_take(const TakePaths& paths, AfterReadErrors after,
                          const ReadProgress& progress) {
  const TakeInfo info = load_take_info(paths);  // throws for a folder that is no take
  // First: on a full disk, the indexes need the reserved space, too.
  remove_working_file(paths.reserve());
  IndexProblems problems;
  io::throw_if_failed(index_segments<wire::PulseMessage>(paths.pulses(), problems));
  for (const std::string& camera : info.cameras) {
    io::throw_if_failed(
        index_segments<wire::FrameMessage>(paths.frames(camera), problems, progress));
  }
  auto [result, keeps_ledger] = count_for_recovery(paths, progress);
  std::ranges::copy(problems.notes, std::back_inserter(result.notes));
  for (const std::string& error : problems.read_errors) {
    const bool is_known =
        std::ranges::find(result.disagreements, error) != result.disagreements.end();
    if (is_known) continue;
    result.disagreements.push_back(error);
    result.read_errors.push_back(error);
  }
  if (keeps_ledger) {
    result.notes.emplace_back("ledger.toml: was kept, because the take was closed before");
    return std::move(result);
  }
  if (!result.read_errors.empty() && after == AfterReadErrors::kStayOpen) {
    return std::move(result);
  }
  for (std::string& problem : map_recorded_sounds(paths, result.ledger.sounds, progress)) {
    result.notes.push_back(std::move(problem));
  }
  result.info.state = TakeState::kRecovered;
  result.info.pulses = result.ledger.commanded;
  const auto unread = save_account(paths, result.info, result.ledger, progress);
  if (!unread) throw std::runtime_error(unread.error().message);
  result.disagreements.insert(result.disagreements.end(), unread->begin(), unread->end());
  return std::move(result);
}

}  // namespace v3d::take
