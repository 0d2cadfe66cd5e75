#include <algorithm>
#include <iostream>
#include <iterator>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "base/core/bytes.h"
#include "base/core/error.h"
#include "base/core/text.h"
#include "sim/cameras/exposure_record.h"
#include "take/logs/frame_log.h"
#include "take/take.h"
#include "v3d-sim/sim_commands.h"

namespace v3d::sim {
namespace {

constexpr size_t kProblemsShown = 10;

/// The exposure record, indexed by camera and device time and by edge time.
class ExposureIndex {
 public:
  explicit ExposureIndex(const std::vector<ExposureLine>& lines) {
    for (const ExposureLine& line : lines) {
      Sent& sent = by_exposure_[{line.camera, line.device_time}];
      sent.line = &line;
      ++sent.images;
      edge_at_[line.edge_time] = line.edge;
    }
  }
  const ExposureLine* exposure(const std::string& camera, DeviceInstant device_time) const {
    const auto found = by_exposure_.find({camera, device_time});
    return found == by_exposure_.end() ? nullptr : found->second.line;
  }
  /// How often the camera sent the image of this exposure: twice with a duplicate fault.
  int64_t images(const std::string& camera, DeviceInstant device_time) const {
    const auto found = by_exposure_.find({camera, device_time});
    return found == by_exposure_.end() ? 0 : found->second.images;
  }
  std::optional<int64_t> edge_at(MonotonicInstant time) const {
    const auto found = edge_at_.find(time);
    return found == edge_at_.end() ? std::nullopt : std::optional(found->second);
  }

 private:
  struct Sent {
    const ExposureLine* line = nullptr;
    int64_t images = 0;
  };
  std::map<std::pair<std::string, DeviceInstant>, Sent> by_exposure_;
  std::map<MonotonicInstant, int64_t> edge_at_;
};

/// The pulses of a take by pulses.lcmlog, with their times.
class LoggedPulses {
 public:
  explicit LoggedPulses(const take::TakePaths& take, double rate_hz) : period_(period_of(rate_hz)) {
    for (const wire::PulseMessage& pulse : take::read_pulses(take.pulses())) {
      logged_[pulse.pulse] = pulse.edge_monotonic;
    }
  }
  /// The time of the first pulse; empty when the log lacks it.
  std::optional<MonotonicInstant> first() const {
    const auto found = logged_.find(0);
    return found == logged_.end() ? std::nullopt : std::optional(found->second);
  }
  /// Whether `pulse` was at `time`. A node that was killed may have exposed pulses after the last
  /// one of its log; they follow at the rate of the take. Empty for any other pulse that the log
  /// lacks.
  std::optional<bool> was_at(int64_t pulse, MonotonicInstant time) const {
    const auto found = logged_.find(pulse);
    if (found != logged_.end()) return found->second == time;
    if (logged_.empty() || pulse < logged_.rbegin()->first) return std::nullopt;
    const auto& [last, last_time] = *logged_.rbegin();
    return std::chrono::abs(last_time + (pulse - last) * period_ - time) < period_ / 4;
  }
  /// Number of logged pulses before `pulse`.
  int64_t logged_before(int64_t pulse) const {
    return std::distance(logged_.begin(), logged_.lower_bound(pulse));
  }

 private:
  const Duration period_;
  std::map<int64_t, MonotonicInstant> logged_;
};

/// Empty when the label of a frame is correct, else the error.
std::string verdict(const std::string& camera, const FrameLabel& label, const ExposureIndex& record,
                    const LoggedPulses& pulses) {
  const ExposureLine* exposure = record.exposure(camera, label.device_time);
  if (exposure == nullptr) {
    return "the record has no exposure of this camera at the device time of the frame";
  }
  const std::optional<bool> is_right = pulses.was_at(label.pulse, exposure->edge_time);
  if (!is_right || !pulses.first()) return "pulses.lcmlog does not contain the pulse";
  if (!*is_right) {
    return "the image shows edge " + std::to_string(exposure->edge) +
           ", which is not the edge of this pulse";
  }
  // The trigger skips pulses that would be late, and pulses may be sent without being sensed. So
  // there are at most as many edges as pulses, and at least as many as sensed pulses.
  const auto first_edge = record.edge_at(*pulses.first());
  const int64_t edges = exposure->edge - first_edge.value_or(0);
  if (!first_edge || edges > label.pulse || edges < pulses.logged_before(label.pulse)) {
    return "the image shows edge " + std::to_string(exposure->edge) +
           ", which has another number in the train";
  }
  return "";
}

/// Compares the frames of one camera with the record, and adds to the check.
class CameraCheck {
 public:
  CameraCheck(std::string camera, const std::filesystem::path& log, const ExposureIndex& record,
              const LoggedPulses& pulses, TakeCheck& check)
      : camera_(std::move(camera)), log_(log), record_(record), pulses_(pulses), check_(check) {}

  void run(int64_t pulses) {
    for (const FrameLabel& label : log_.labels()) check_label(label);
    for (const auto& [device_time, frames] : frames_of_) check_repetition(device_time, frames);
    for (int64_t pulse = 0; pulse < pulses; ++pulse) {
      const auto shown = shown_.find(pulse);
      if (shown == shown_.end()) {
        ++check_.frames_missing;
        report(pulse, ": missing");
      } else {
        check_image(*shown->second);
      }
    }
  }

 private:
  void check_label(const FrameLabel& label) {
    ++check_.frames_received;
    ++frames_of_[label.device_time];
    const FrameLabel*& shown = shown_[label.pulse];
    if (shown == nullptr || (shown->suspect && !label.suspect)) shown = &label;
    const std::string wrong = verdict(camera_, label, record_, pulses_);
    if (wrong.empty()) return;
    ++check_.frames_mislabelled;
    check_.mislabelled_not_suspect += label.suspect ? 0 : 1;
    report(label.pulse, (label.suspect ? " (suspect): " : ": ") + wrong);
  }

  void check_repetition(DeviceInstant device_time, int64_t frames) {
    const int64_t sent = std::max<int64_t>(1, record_.images(camera_, device_time));
    if (frames <= sent) return;
    check_.frames_repeated += frames - sent;
    const ExposureLine* const exposure = record_.exposure(camera_, device_time);
    add(camera_ + " edge " + (exposure == nullptr ? "unknown" : std::to_string(exposure->edge)) +
        ": " + std::to_string(frames) + " frames of " + std::to_string(sent) + " sent");
  }

  /// `label`: of the frame that FrameLogReader::read() returns for its pulse.
  void check_image(const FrameLabel& label) {
    const ExposureLine* const exposure = record_.exposure(camera_, label.device_time);
    if (exposure == nullptr || exposure->checksum == 0) return;
    const std::optional<Frame> frame = log_.read(label.pulse);
    if (frame && checksum({frame->image.bytes}) == exposure->checksum) return;
    ++check_.images_wrong;
    report(label.pulse,
           frame ? ": the image has other bytes than the sent one" : ": the image cannot be read");
  }

  void report(int64_t pulse, const std::string& problem) {
    add(camera_ + " pulse " + std::to_string(pulse) + problem);
  }
  void add(const std::string& problem) {
    if (check_.problems.size() < kProblemsShown) check_.problems.push_back(problem);
  }

  const std::string camera_;
  take::FrameLogReader log_;
  const ExposureIndex& record_;
  const LoggedPulses& pulses_;
  TakeCheck& check_;
  std::map<DeviceInstant, int64_t> frames_of_;  ///< number of frames of each exposure
  std::map<int64_t, const FrameLabel*> shown_;  ///< the frame that readers use, by pulse
};

}  // namespace

TakeCheck check_take(const std::filesystem::path& take, const std::vector<ExposureLine>& lines) {
  const take::TakePaths paths{take};
  const take::TakeInfo info = load_take_info(paths);
  const ExposureIndex record(lines);
  const LoggedPulses pulses(paths, info.rate_hz);
  TakeCheck check;
  for (const std::string& camera : info.cameras) {
    CameraCheck(camera, paths.frames(camera), record, pulses, check).run(info.pulses);
  }
  return check;
}

namespace {

struct Arguments {
  std::string take;
  std::string exposures;
  bool json = false;
};

int run(const Arguments& arguments) {
  const TakeCheck check = check_take(arguments.take, load_exposures(arguments.exposures));
  for (const std::string& problem : check.problems) {
    std::cerr << problem << '\n';
  }
  if (arguments.json) {
    std::cout << nlohmann::ordered_json{{"frames_received", check.frames_received},
                                        {"frames_missing", check.frames_missing},
                                        {"frames_mislabelled", check.frames_mislabelled},
                                        {"mislabelled_silently", check.mislabelled_not_suspect},
                                        {"frames_repeated", check.frames_repeated},
                                        {"images_wrong", check.images_wrong}}
                     .dump()
              << '\n';
  } else {
    std::cout << format_count(check.frames_received) << " frames received, "
              << format_count(check.frames_missing) << " missing, "
              << format_count(check.frames_mislabelled) << " mislabelled, "
              << format_count(check.mislabelled_not_suspect) << " of them not suspect, "
              << format_count(check.frames_repeated) << " repeated, "
              << format_count(check.images_wrong) << " with wrong images\n";
  }
  return check.whole() ? kExitDone : kExitIncomplete;
}

}  // namespace

void add_check_command(cli::Command app, int& status) {
  cli::Command command = app.add_subcommand(
      "check",
      "Compare a recorded take with the simulator's record of the edge and pixels of each image");
  auto arguments = std::make_shared<Arguments>();
  command.add_option("TAKE", arguments->take, "Folder of the take").required();
  command.add_option("--exposures", arguments->exposures, "exposures.csv of the simulated studio")
      .required();
  command.add_flag("--json", arguments->json, "One JSON object on stdout");
  command.footer(
      "Exit status 3 when a frame is missing, mislabelled or repeated, or has other pixels.\n"
      "Example:\n"
      "  v3d-sim check studio/kendo-01 --exposures studio/exposures.csv --json");
  command.on_parsed([arguments, &status] { status = run(*arguments); });
}

}  // namespace v3d::sim
