#include "daemon/captured/resume_state.h"

#include <algorithm>
#include <limits>

#include "base/core/error.h"
#include "capture/sync/pulse_times.h"
#include "take/logs/event_log.h"
#include "take/logs/log_files.h"
#include "wire/codec.h"
#include "wire/messages.h"

namespace v3d::captured {
namespace {

/// Frames from which clock and latency of the camera are estimated; more would not improve them.
constexpr size_t kLastFrames = 256;
/// A larger latency means that the clock was set while the pulses were recorded.
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

/// The lower quartile: late frames do not change it, nor do a few pulses that were timed late.
std::optional<Duration> latency_of(const std::vector<FrameLabel>& labels, const EdgeTimes& edges) {
  std::vector<Duration> latencies;
  for (const FrameLabel& label : labels) {
    const auto edge = edges.find(label.pulse);
    if (edge != edges.end() && edge->second) latencies.push_back(label.received - *edge->second);
  }
  if (latencies.size() < capture::kStartFrames) return std::nullopt;
  const auto quartile = latencies.begin() + std::ssize(latencies) / 4;
  std::nth_element(latencies.begin(), quartile, latencies.end());
  if (*quartile < Duration::zero() || *quartile > kMaxLatency) return std::nullopt;
  return *quartile;
}

/// The time of a pulse on the clock of this node. A time of the event that is the time of sending
/// is that of another clock, and a damaged one has any value.
std::optional<RealtimeInstant> time_here(const take::EventSpan& event,
                                         const wire::PulseMessage& pulse) {
  constexpr int64_t kNsPerUs = 1000;
  const bool is_known = event.utime > 0 &&
                        event.utime <= std::numeric_limits<int64_t>::max() / kNsPerUs &&
                        event.utime != to_ns(pulse.sent) / kNsPerUs;
  return is_known ? std::optional(from_ns<Realtime>(event.utime * kNsPerUs)) : std::nullopt;
}

EdgeTimes edges_of(const take::EventLogReader& log, const take::ReadProgress& progress) {
  if (!log.read_errors().empty()) throw InputError(log.read_errors().front());
  EdgeTimes edges;
  for (const take::EventSpan& event : log.events()) {
    if (event.data_size > take::kMaxPulseBytes) continue;
    const auto bytes = log.read(event);
    if (!bytes) throw InputError(bytes.error().message);
    if (progress) progress();
    const auto pulse = wire::decode<wire::PulseMessage>(*bytes);
    if (pulse) edges[pulse->pulse] = time_here(event, *pulse);
  }
  return edges;
}

}  // namespace

EdgeTimes read_edge_times(const take::TakePaths& take, std::vector<std::string>& problems,
                          const take::ReadProgress& progress) {
  if (take::is_absent_log(take.pulses())) return {};
  try {
    return edges_of(take::EventLogReader(take.pulses(), progress), progress);
  } catch (const InputError& error) {
    problems.emplace_back(error.what());
    return {};
  }
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
