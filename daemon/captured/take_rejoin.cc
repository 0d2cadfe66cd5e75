#include "daemon/captured/take_rejoin.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "capture/segmentation/background.h"
#include "daemon/node/advice.h"
#include "daemon/node/take_folder.h"

namespace v3d::captured {

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
