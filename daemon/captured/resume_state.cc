#include "daemon/captured/resume_state.h"

#include <algorithm>

#include "base/core/error.h"
#include "capture/sync/pulse_times.h"
#include "take/logs/log_files.h"

namespace v3d::captured {
namespace {

/// Frames from which clock and latency of the camera are estimated; more would not improve them.
constexpr size_t kLastFrames = 256;
/// A larger latency means that the clocks of this host and the trigger's host differ.
constexpr Duration kMaxLatency = std::chrono::seconds(1);

/// Adds to `problems` why frames of the log may be absent.
std::optional<take::FrameLogReader> read_log(const std::filesystem::path& log,
                                             const take::ReadProgress& progress,
                                             std::vector<std::string>& problems) {
  if (take::is_absent_log(log)) return std::nullopt;
  try {
    take::FrameLogReader reader(log, progress);
    const std::vector<std::string>& errors = reader.read_errors();
    problems.insert(problems.end(), errors.begin(), errors.end());
    return reader;
  } catch (const InputError& error) {
    problems.emplace_back(error.what());
    return std::nullopt;
  }
}

/// The last frames that are not suspect, with ascending pulse numbers.
std::vector<FrameLabel> last_certain(const std::vector<FrameLabel>& labels) {
  std::vector<FrameLabel> last;
  for (auto label = labels.rbegin(); label != labels.rend() && last.size() < kLastFrames; ++label) {
    const bool falls = last.empty() || label->pulse < last.back().pulse;
    if (!label->suspect && falls) last.push_back(*label);
  }
  std::reverse(last.begin(), last.end());
  return last;
}

std::vector<capture::KnownFrame> known_frames(const std::vector<FrameLabel>& labels) {
  const RealtimeInstant realtime = Realtime::now();
  const MonotonicInstant monotonic = Monotonic::now();
  std::vector<capture::KnownFrame> frames;
  for (const FrameLabel& label : labels) {
    frames.push_back({.stamp = {.exposed = label.device_time,
                                .counter = label.camera_counter,
                                .received = monotonic - (realtime - label.received)},
                      .pulse = label.pulse});
  }
  return frames;
}

std::optional<Duration> latency_of(const std::vector<FrameLabel>& labels, const EdgeTimes& edges) {
  std::vector<Duration> latencies;
  for (const FrameLabel& label : labels) {
    const auto edge = edges.find(label.pulse);
    if (edge != edges.end()) latencies.push_back(label.received - edge->second);
  }
  if (latencies.size() < capture::kStartFrames) return std::nullopt;
  const Duration shortest = *std::min_element(latencies.begin(), latencies.end());
  if (shortest < Duration::zero() || shortest > kMaxLatency) return std::nullopt;
  return shortest;
}

}  // namespace

EdgeTimes read_edge_times(const take::TakePaths& take, std::vector<std::string>& problems,
                          const take::ReadProgress& progress) {
  EdgeTimes edges;
  if (take::is_absent_log(take.pulses())) return edges;
  try {
    for (const wire::PulseMessage& pulse : take::read_pulses(take.pulses(), progress))
      edges[pulse.pulse] = pulse.edge;
  } catch (const InputError& error) {
    problems.emplace_back(error.what());
  }
  return edges;
}

ResumeState read_resume_state(const take::TakePaths& take, const std::string& camera,
                              const EdgeTimes& edges, const take::ReadProgress& progress) {
  ResumeState state;
  state.log = read_log(take.frames(camera), progress, state.problems);
  const std::vector<FrameLabel> none;
  const std::vector<FrameLabel>& labels = state.log ? state.log->labels() : none;
  for (const FrameLabel& label : labels) {
    state.account.add(label.pulse, label.suspect);
    state.exposures.add(label.camera_counter);
  }
  const std::vector<FrameLabel> last = last_certain(labels);
  state.camera = {.frames = known_frames(last),
                  .latency = latency_of(last, edges),
                  .delivered = std::ssize(labels),
                  .suspect = std::ranges::count_if(labels, &FrameLabel::suspect)};
  return state;
}

}  // namespace v3d::captured
