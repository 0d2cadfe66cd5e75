#include <iostream>
#include <iterator>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>

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
      by_exposure_[{line.camera, line.device_time}] = &line;
      edge_at_[line.edge_time] = line.edge;
    }
  }
  const ExposureLine* exposure(const std::string& camera, DeviceInstant device_time) const {
    const auto found = by_exposure_.find({camera, device_time});
    return found == by_exposure_.end() ? nullptr : found->second;
  }
  std::optional<int64_t> edge_at(MonotonicInstant time) const {
    const auto found = edge_at_.find(time);
    return found == edge_at_.end() ? std::nullopt : std::optional(found->second);
  }

 private:
  std::map<std::pair<std::string, DeviceInstant>, const ExposureLine*> by_exposure_;
  std::map<MonotonicInstant, int64_t> edge_at_;
};

/// Empty when the label of a frame is correct, else the error.
std::string verdict(const std::string& camera, const FrameLabel& label, const ExposureIndex& record,
                    const std::map<int64_t, MonotonicInstant>& pulses) {
  const ExposureLine* exposure = record.exposure(camera, label.device_time);
  if (exposure == nullptr) {
    return "the record has no exposure of this camera at the device time of the frame";
  }
  const auto pulse = pulses.find(label.pulse);
  const auto first = pulses.find(0);
  if (pulse == pulses.end() || first == pulses.end()) {
    return "pulses.lcmlog does not contain the pulse";
  }
  if (exposure->edge_time != pulse->second) {
    return "the image shows edge " + std::to_string(exposure->edge) +
           ", which is not the edge of this pulse";
  }
  // The trigger skips pulses that would be late, and pulses may be sent without being sensed. So
  // there are at most as many edges as pulses, and at least as many as sensed pulses.
  const auto first_edge = record.edge_at(first->second);
  const int64_t edges = exposure->edge - first_edge.value_or(0);
  if (!first_edge || edges > label.pulse || edges < std::distance(first, pulse)) {
    return "the image shows edge " + std::to_string(exposure->edge) +
           ", which has another number in the train";
  }
  return "";
}

}  // namespace

TakeCheck check_take(const std::filesystem::path& take, const std::vector<ExposureLine>& lines) {
  const take::TakePaths paths{take};
  const take::TakeInfo info = load_take_info(paths);
  const ExposureIndex record(lines);
  std::map<int64_t, MonotonicInstant> pulses;
  for (const wire::PulseMessage& pulse : take::read_pulses(paths.pulses())) {
    pulses[pulse.pulse] = pulse.edge_monotonic;
  }
  TakeCheck check;
  const auto report = [&](const std::string& problem) {
    if (check.problems.size() < kProblemsShown) {
      check.problems.push_back(problem);
    }
  };
  for (const std::string& camera : info.cameras) {
    const take::FrameLogReader log(paths.frames(camera));
    std::set<int64_t> seen;
    for (const FrameLabel& label : log.labels()) {
      ++check.frames_received;
      seen.insert(label.pulse);
      const std::string wrong = verdict(camera, label, record, pulses);
      if (!wrong.empty()) {
        ++check.frames_mislabelled;
        check.mislabelled_not_suspect += label.suspect ? 0 : 1;
        report(camera + " pulse " + std::to_string(label.pulse) +
               (label.suspect ? " (suspect): " : ": ") + wrong);
      }
    }
    for (int64_t pulse = 0; pulse < info.pulses; ++pulse) {
      if (!seen.contains(pulse)) {
        ++check.frames_missing;
        report(camera + " pulse " + std::to_string(pulse) + ": missing");
      }
    }
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
                                        {"mislabelled_silently", check.mislabelled_not_suspect}}
                     .dump()
              << '\n';
  } else {
    std::cout << format_count(check.frames_received) << " frames received, "
              << format_count(check.frames_missing) << " missing, "
              << format_count(check.frames_mislabelled) << " mislabelled, "
              << format_count(check.mislabelled_not_suspect) << " of them not suspect\n";
  }
  return check.whole() ? kExitDone : kExitIncomplete;
}

}  // namespace

void add_check_command(cli::Command app, int& status) {
  cli::Command command = app.add_subcommand(
      "check",
      "Compare a recorded take with the simulator's record of the edge that each image shows");
  auto arguments = std::make_shared<Arguments>();
  command.add_option("TAKE", arguments->take, "Folder of the take").required();
  command.add_option("--exposures", arguments->exposures, "exposures.csv of the simulated studio")
      .required();
  command.add_flag("--json", arguments->json, "One JSON object on stdout");
  command.footer(
      "Exit status 3 when a frame is missing or mislabelled.\n"
      "Example:\n"
      "  v3d-sim check studio/kendo-01 --exposures studio/exposures.csv --json");
  command.on_parsed([arguments, &status] { status = run(*arguments); });
}

}  // namespace v3d::sim
