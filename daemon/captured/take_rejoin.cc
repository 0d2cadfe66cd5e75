#include "daemon/captured/take_rejoin.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <limits>
#include <stdexcept>
#include <utility>

#include "base/core/error.h"
#include "capture/segmentation/background.h"
#include "capture/sync/pulse_times.h"
#include "daemon/node/advice.h"
#include "daemon/node/take_folder.h"
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

RecordedTakeReader::RecordedTakeReader(take::TakePaths take, std::vector<std::string> cameras,
                                       take::ReadProgress progress)
    : take_(std::move(take)), cameras_(std::move(cameras)) {
  std::packaged_task<RecordedTake()> task([this, progress = std::move(progress)] {
    return read([&] {
      if (stopping_) throw std::runtime_error("the reading was cancelled");
      if (progress) progress();
    });
  });
  result_ = task.get_future();
  thread_ = std::thread(std::move(task));
}

/// Plates first: without them the node cannot record, and the logs need not be read.
RecordedTake RecordedTakeReader::read(const take::ReadProgress& progress) {
  RecordedTake recorded;
  for (const std::string& camera : cameras_) {
    progress();
    recorded.segmenters.emplace(
        camera,
        segmentation::Segmenter(segmentation::load_background(take_.background(), camera), {}));
  }
  recorded.edges = read_edge_times(take_, recorded.problems, progress);
  for (const std::string& camera : cameras_) {
    ++opened_logs_;
    recorded.cameras.emplace(camera, read_resume_state(take_, camera, recorded.edges, progress));
  }
  return recorded;
}

std::string RecordedTakeReader::file() const {
  const size_t opened = opened_logs_;
  return (opened == 0 ? take_.pulses() : take_.frames(cameras_[opened - 1])).filename();
}

RecordedTakeReader::~RecordedTakeReader() {
  stopping_ = true;
  thread_.join();
}

bool RecordedTakeReader::is_done() const {
  return result_.wait_for(std::chrono::seconds(0)) == std::future_status::ready;
}

std::optional<TakeToResume> TakeRejoin::poll(node::TrainMonitor& train) {
  was_polled_ = true;
  if (reading_) {
    follow(train);
  } else if (!failure_.empty()) {
    forget_ended_take(train);
  } else if (const auto found = commands_.find_running(train)) {
    begin(*found);
  }
  if (!reading_ || !reading_->reader->is_done()) return std::nullopt;
  return TakeToResume{.order = order_,
                      .commanded = reading_->commanded,
                      .lock = *std::move(reading_->lock),
                      .recorded = reading_->reader->result()};
}

void TakeRejoin::begin(const node::PersistedCommands::Found& found) {
  order_ = found.command;
  const take::TakePaths paths = node::take_paths(studio_, order_.take);
  auto reading = std::make_unique<Reading>();
  reading->no_signing = signer_.hold();
  reading->commanded = found.commanded;
  reading->lock.emplace(node::lock_take(paths, node_));
  const std::vector<std::string> recorded = load_take_info(paths).cameras;
  std::vector<std::string> cameras;
  for (const StudioCamera& camera : studio_.cameras_of(node_)) {
    const bool is_recorded = std::ranges::find(recorded, camera.name) != recorded.end();
    if (is_recorded) cameras.push_back(camera.name);
  }
  reading->reader.emplace(paths, std::move(cameras), progress_);
  signer_.set_paused(true);
  reading_ = std::move(reading);
  events_.send(wire::Severity::kWarning, "take",
               node_ + " restarted and does not record " + order_.take +
                   " yet: it reads what it has recorded",
               node::advice::kReadsLogs);
}

/// Cancels when another take, or none, is recorded by now.
void TakeRejoin::follow(node::TrainMonitor& train) {
  const auto running = train.running();
  if (!running) return;
  reading_->commanded = running->commanded;
  if (running->take == order_.take) return;
  spdlog::info("{} has ended", order_.take);
  cancel();
}

/// The failure is that of a take that has ended.
void TakeRejoin::forget_ended_take(node::TrainMonitor& train) {
  const auto running = train.running();
  if (running && running->take != order_.take) failure_.clear();
}

void TakeRejoin::cancel_unless_polled() {
  if (std::exchange(was_polled_, false)) return;
  cancel();
  failure_.clear();
}

void TakeRejoin::cancel() {
  if (!reading_) return;
  reading_.reset();
  signer_.set_paused(false);
}

void TakeRejoin::finish(int64_t commanded) {
  cancel();
  events_.send(wire::Severity::kWarning, "take",
               node_ + " restarted and records " + order_.take + " again, from pulse " +
                   std::to_string(commanded),
               node::advice::kRejoined);
}

void TakeRejoin::fail(const std::string& cause) {
  cancel();
  const std::string take = order_.take.empty() ? "the running take" : order_.take;
  failure_ = "does not record " + take + ": " + cause;
  events_.send(wire::Severity::kAlarm, "take", node_ + " " + failure_, node::advice::kNotRejoined);
}

std::string TakeRejoin::text() const {
  if (!reading_) return failure_;
  return "does not record " + order_.take + " yet: reads " + reading_->reader->file();
}

}  // namespace v3d::captured
