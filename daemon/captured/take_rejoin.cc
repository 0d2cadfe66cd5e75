#include "daemon/captured/take_rejoin.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "daemon/node/take_folder.h"

namespace v3d::captured {
namespace {

RecordedTake read_recorded_take(const take::TakePaths& take,
                                const std::vector<std::string>& cameras,
                                const take::ReadProgress& progress) {
  RecordedTake recorded;
  recorded.edges = read_edge_times(take, recorded.problems);
  for (const std::string& camera : cameras) {
    recorded.cameras.emplace(camera, read_resume_state(take, camera, recorded.edges, progress));
  }
  return recorded;
}

}  // namespace

RecordedTakeReader::RecordedTakeReader(take::TakePaths take, std::vector<std::string> cameras,
                                       take::ReadProgress progress) {
  std::packaged_task<RecordedTake()> task(
      [this, take = std::move(take), cameras = std::move(cameras), progress = std::move(progress)] {
        return read_recorded_take(take, cameras, [&] {
          if (stopping_) throw std::runtime_error("the reading was cancelled");
          if (progress) progress();
        });
      });
  result_ = task.get_future();
  thread_ = std::thread(std::move(task));
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
  order_ = found.order;
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
  reading->reader.emplace(paths, std::move(cameras));
  signer_.set_paused(true);
  reading_ = std::move(reading);
  spdlog::info("{} is still recorded: its logs are read, to record into it again", order_.take);
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

void TakeRejoin::cancel_unless_polled() {
  if (!std::exchange(was_polled_, false)) cancel();
}

void TakeRejoin::cancel() {
  if (!reading_) return;
  reading_.reset();
  signer_.set_paused(false);
}

bool TakeRejoin::give_up() {
  cancel();
  if (order_.take.empty()) return false;
  const take::TakePaths paths = node::take_paths(studio_, order_.take);
  const auto holder = take_lock_holder(paths);
  if (!holder || !holder->empty()) return false;
  node::drop_command(studio_, node_, order_.take);
  node::recover_reopened_take(paths, node_);
  return true;
}

}  // namespace v3d::captured
