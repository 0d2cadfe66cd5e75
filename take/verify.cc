#include "take/verify.h"

#include <algorithm>
#include <cerrno>

#include "base/error.h"
#include "base/units.h"
#include "take/event_log.h"
#include "take/exposure_count.h"
#include "take/frame_log.h"
#include "take/log_segments.h"
#include "take/mesh_file.h"
#include "take/take_removal.h"

namespace v3d {
namespace {

/// How much of a log is read: the whole frames, or their labels.
enum class Depth : uint8_t { kFrames, kLabels };

/// The label of the frame; empty when it is none of this camera or, as far as it is read, damaged.
/// Of bytes that do not begin as a frame no more is read: their length is not to be trusted.
io::Result<std::optional<FrameLabel>> read_label(const EventLogReader& log, const EventSpan& event,
                                                 const std::string& camera, Depth depth) {
  const auto begin = log.read(event, kFrameHeadSize);
  if (!begin) return tl::make_unexpected(begin.error());
  const auto head = decode_frame_head(*begin);
  if (!head || head->camera != camera || head->message_size != event.data_size) return std::nullopt;
  if (depth == Depth::kLabels) return head->label;
  const auto whole = log.read(event);
  if (!whole) return tl::make_unexpected(whole.error());
  const auto message = decode<FrameMessage>(*whole);
  return message ? std::optional(message->frame.label) : std::nullopt;
}

class Verifier {
 public:
  Verifier(const TakePaths& paths, Depth depth) : paths_(paths), depth_(depth) {
    result_.info = load_take_info(paths);
  }

  Verification run() {
    const std::optional<Ledger> stored = stored_ledger();
    count_pulses(stored);
    for (const std::string& camera : result_.info.cameras) {
      CameraLedger counted = count_frames(camera);
      if (stored) compare(*stored, counted);
      result_.ledger.cameras.push_back(std::move(counted));
    }
    check_calib();
    check_mesh();
    return std::move(result_);
  }

 private:
  void disagree(const std::filesystem::path& file, const std::string& what) {
    result_.disagreements.push_back(file.filename().string() + ": " + what);
  }

  std::optional<Ledger> stored_ledger() {
    try {
      Ledger stored = load_ledger(paths_.ledger());
      // Of a recovery, after which a daemon may have continued the take: it knows less than the
      // logs.
      const TakeState state = result_.info.state;
      const bool recovers = depth_ == Depth::kLabels && state == TakeState::kRecovered;
      if (recovers || state == TakeState::kRecording) return std::nullopt;
      return stored;
    } catch (const InputError& error) {
      result_.disagreements.emplace_back(error.what());
      return std::nullopt;
    }
  }

  void count_pulses(const std::optional<Ledger>& stored) {
    Ledger& ledger = result_.ledger;
    ledger.take = result_.info.name;
    PulseSet sensed;
    try {
      for (const PulseMessage& message : read_pulses(paths_.pulses())) {
        if (message.pulse < kMostPulses) {
          sensed.insert(message.pulse);
        } else {
          disagree(paths_.pulses(), "holds the impossible pulse " + format_count(message.pulse));
        }
      }
    } catch (const InputError& error) {
      result_.disagreements.emplace_back(error.what());
    }
    recount_pulses(sensed, result_.info.pulses, stored, ledger);
    if (stored && stored->sensed && *stored->sensed != sensed.size()) {
      disagree(paths_.pulses(), "holds " + format_count(sensed.size()) +
                                    " pulses, the ledger says " + format_count(*stored->sensed));
    }
    if (result_.info.state == TakeState::kComplete && result_.info.pulses != ledger.commanded) {
      disagree(paths_.info(), "says " + format_count(result_.info.pulses) +
                                  " pulses, the ledger says " + format_count(ledger.commanded));
    }
  }

  CameraLedger count_frames(const std::string& camera) {
    CameraAccount account;
    ExposureCount exposures;
    if (const auto log = EventLogReader::open(paths_.frames(camera))) {
      count_events(*log, camera, account, exposures);
    } else {
      result_.disagreements.push_back(log.error().message);
    }
    CameraLedger counted = account.ledger(camera, result_.ledger.commanded);
    counted.exposed = exposures.exposed();
    return counted;
  }

  void count_events(const EventLogReader& log, const std::string& camera, CameraAccount& account,
                    ExposureCount& exposures) {
    const std::filesystem::path file = paths_.frames(camera);
    int64_t damaged = log.damaged_places(), unreadable = 0;
    std::vector<std::string> errors = log.read_errors();
    for (const EventSpan& event : log.events()) {
      const auto label = read_label(log, event, camera, depth_);
      if (!label) {
        ++unreadable;
        if (errors.empty()) errors.push_back(label.error().message);
      } else if (!*label) {
        ++damaged;
      } else {
        account.add((*label)->pulse, (*label)->suspect);
        exposures.add((*label)->camera_counter);
      }
    }
    for (std::string& error : errors) result_.disagreements.push_back(std::move(error));
    if (unreadable > 0) disagree(file, format_count(unreadable) + " events cannot be read");
    if (damaged > 0) disagree(file, format_count(damaged) + " damaged events");
    if (log.torn_bytes() > 0) {
      disagree(file, "ends in an unfinished event of " + format_count(log.torn_bytes()) +
                         " bytes, which is left out");
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
               found->suspect != counted.suspect) {
      disagree(paths_.frames(counted.name),
               "its missing, duplicate or suspect pulses are not those of the ledger");
    }
  }

  void check_calib() {
    if (!std::filesystem::exists(paths_.calib())) disagree(paths_.calib(), "missing");
  }

  void check_mesh() {
    if (!std::filesystem::exists(paths_.mesh())) return;  // a take need not be reconstructed
    try {
      MeshFileReader meshes(paths_.mesh());
      const auto damaged = std::count_if(meshes.pulses().begin(), meshes.pulses().end(),
                                         [&](int64_t pulse) { return !meshes.read(pulse); });
      if (damaged > 0) disagree(paths_.mesh(), format_count(damaged) + " damaged meshes");
    } catch (const InputError& error) {
      result_.disagreements.emplace_back(error.what());
    }
  }

  const TakePaths paths_;
  const Depth depth_;
  Verification result_;
};

/// What a recovery finds in a segment. A power cut may leave the length of the last events without
/// their bytes; these events are not counted. Damage farther back than what can have waited for the
/// disk has another cause and stays inside the log. Fails when the disk does not give an event.
template <class Message>
io::Result<SegmentIndex> index_of(const EventLogReader& log, uint32_t number) {
  constexpr uint64_t kMaxUnwrittenBytes = 64 << 20;
  const LogSegment& segment = log.segments()[number];
  SegmentIndex index{.bytes = segment.bytes,
                     .whole_bytes = 0,
                     .events = segment.events,
                     .damaged_places = segment.damaged_places};
  uint64_t end = 0;
  int64_t left_out = 0;
  for (auto event = log.events().rbegin(); event != log.events().rend(); ++event) {
    if (event->segment != number) continue;
    const uint64_t event_end = event->data_offset + event->data_size;
    if (end == 0) end = index.whole_bytes = event_end;
    if (end - event_end > kMaxUnwrittenBytes) return index;
    const auto bytes = log.read(*event);
    if (!bytes) return tl::make_unexpected(bytes.error());
    if (decode<Message>(*bytes)) {
      index.whole_bytes = event_end;
      index.events -= left_out;
      return index;
    }
    ++left_out;
  }
  return index;
}

/// Writes the index of every segment that has none. A segment that the disk does not give whole
/// gets none; `read_errors` says so, and the next recovery tries again.
template <class Message>
io::Status index_segments(const std::filesystem::path& path,
                          std::vector<std::string>& read_errors) {
  if (is_absent_log(path)) return {};  // the verification reports it
  const auto log = EventLogReader::open(path);
  if (!log) return tl::make_unexpected(log.error());
  for (uint32_t number = 0; number < log->segments().size(); ++number) {
    const LogSegment& segment = log->segments()[number];
    // What the ledger is about to say must not survive a power cut that these bytes do not.
    if (auto synced = segment.file.sync(); !synced) return synced;
    if (segment.index) continue;
    io::Result<SegmentIndex> index =
        tl::make_unexpected(io::IoError{.code = EIO, .message = segment.read_error});
    if (segment.read_error.empty()) index = index_of<Message>(*log, number);
    if (!index) {
      read_errors.push_back(index.error().message);
    } else if (auto saved = save_segment_index(segment.file.path(), *index); !saved) {
      return saved;
    }
  }
  return {};
}

}  // namespace

void recount_pulses(const PulseSet& sensed, int64_t known, const std::optional<Ledger>& stored,
                    Ledger& ledger) {
  const bool has_sense_line = !stored || stored->sensed;
  if (has_sense_line) ledger.sensed = sensed.size();
  ledger.commanded = stored ? stored->commanded : std::max(known, sensed.last() + 1);
  if (has_sense_line) ledger.unsensed = sensed.missing(ledger.commanded);
  if (!stored) return;
  ledger.extra = stored->extra;  // not in the log
  ledger.runt = stored->runt;
}

Verification verify_take(const TakePaths& paths) { return Verifier(paths, Depth::kFrames).run(); }

Verification recover_take(const TakePaths& paths) {
  std::vector<std::string> read_errors;
  io::throw_if_failed(index_segments<PulseMessage>(paths.pulses(), read_errors));
  for (const std::string& camera : load_take_info(paths).cameras) {
    io::throw_if_failed(index_segments<FrameMessage>(paths.frames(camera), read_errors));
  }
  Verification result = Verifier(paths, Depth::kLabels).run();
  for (const std::string& error : read_errors) {
    const bool is_known =
        std::ranges::find(result.disagreements, error) != result.disagreements.end();
    if (!is_known) result.disagreements.push_back(error);
  }
  remove_working_file(paths.reserve());
  result.info.state = TakeState::kRecovered;
  result.info.pulses = result.ledger.commanded;
  io::throw_if_failed(save_ledger(paths.ledger(), result.ledger));
  io::throw_if_failed(save_take_info(paths, result.info));
  return result;
}

}  // namespace v3d
