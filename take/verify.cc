#include "take/verify.h"

#include <algorithm>

#include "base/error.h"
#include "base/units.h"
#include "take/event_log.h"
#include "take/exposure_count.h"
#include "take/frame_log.h"
#include "take/mesh_file.h"

namespace v3d {
namespace {

/// How much of a log is read: the whole frames, or their labels.
enum class Depth : uint8_t { kFrames, kLabels };

/// The label of the frame, if it is one of this camera and, as far as it is read, undamaged.
std::optional<FrameLabel> label_of(const EventLogReader& log, const EventSpan& event,
                                   const std::string& camera, Depth depth) {
  if (depth == Depth::kFrames) {
    const auto message = decode<FrameMessage>(log.read(event));
    if (!message || message->frame.camera != camera) return std::nullopt;
    return message->frame.label;
  }
  const auto head = decode_frame_head(log.read(event, kFrameHeadSize));
  if (!head || head->camera != camera || head->message_size != event.data_size) return std::nullopt;
  return head->label;
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
      return load_ledger(paths_.ledger());
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
    const bool has_sense_line = !stored || stored->sensed;
    if (has_sense_line) ledger.sensed = sensed.size();
    // A take that nobody closed does not know how many pulses were commanded: those that were
    // sensed tell.
    ledger.commanded =
        stored ? stored->commanded : std::max(result_.info.pulses, sensed.last() + 1);
    if (has_sense_line) ledger.unsensed = sensed.missing(ledger.commanded);
    if (stored) {
      ledger.extra = stored->extra;  // not in the log
      ledger.runt = stored->runt;
    }
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
    const std::filesystem::path file = paths_.frames(camera);
    CameraAccount account;
    ExposureCount exposures;
    try {
      const EventLogReader log(file);
      int64_t damaged = log.damaged_places();
      for (const EventSpan& event : log.events()) {
        const auto label = label_of(log, event, camera, depth_);
        if (!label) {
          ++damaged;
          continue;
        }
        account.add(label->pulse, label->suspect);
        exposures.add(label->camera_counter);
      }
      if (damaged > 0) disagree(file, format_count(damaged) + " damaged events");
      if (log.torn_bytes() > 0) {
        disagree(file, "ends in an unfinished event of " + format_count(log.torn_bytes()) +
                           " bytes, which is left out");
      }
    } catch (const InputError& error) {
      result_.disagreements.emplace_back(error.what());
    }
    CameraLedger counted = account.ledger(camera, result_.ledger.commanded);
    counted.exposed = exposures.exposed();
    return counted;
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

/// Where the log's last undamaged event ends. The disk may have kept the length of the last events,
/// and not their bytes; of more than what waited for the disk, the fault lies elsewhere, and it
/// stays.
template <class Message>
uint64_t sound_end(const EventLogReader& log) {
  constexpr uint64_t kMostWaiting = 64 << 20;
  const std::vector<EventSpan>& events = log.events();
  if (events.empty()) return 0;
  const uint64_t end = events.back().data_offset + events.back().data_size;
  for (auto event = events.rbegin(); event != events.rend(); ++event) {
    const uint64_t event_end = event->data_offset + event->data_size;
    if (end - event_end > kMostWaiting) break;
    if (decode<Message>(log.read(*event))) return event_end;
  }
  return end;
}

/// A log that does not open holds no event: nothing is lost with it.
template <class Message>
void cut_behind_last_event(const std::filesystem::path& path) {
  if (!std::filesystem::is_regular_file(path)) return;
  uint64_t end = 0;
  try {
    end = sound_end<Message>(EventLogReader(path));
  } catch (const InputError&) {
  }
  if (end < std::filesystem::file_size(path)) std::filesystem::resize_file(path, end);
}

}  // namespace

Verification verify_take(const TakePaths& paths) { return Verifier(paths, Depth::kFrames).run(); }

Verification recover_take(const TakePaths& paths) {
  cut_behind_last_event<PulseMessage>(paths.pulses());
  for (const std::string& camera : load_take_info(paths).cameras) {
    cut_behind_last_event<FrameMessage>(paths.frames(camera));
  }
  Verification result = Verifier(paths, Depth::kLabels).run();
  std::filesystem::remove(paths.reserve());
  result.info.state = TakeState::kRecovered;
  result.info.pulses = result.ledger.commanded;
  save_ledger(paths.ledger(), result.ledger);
  save_take_info(paths, result.info);
  return result;
}

}  // namespace v3d
