#include "capture/cameras/camera_worker.h"

#include <condition_variable>
#include <deque>
#include <mutex>
#include <thread>
#include <utility>

#include "capture/cameras/camera_session.h"

namespace v3d::capture {

std::string_view name(CameraState state) {
  switch (state) {
    case CameraState::kOpening:
      return "opening";
    case CameraState::kIdle:
      return "idle";
    case CameraState::kSettling:
      return "settling";
    case CameraState::kReady:
      return "ready";
    case CameraState::kRunning:
      return "running";
    case CameraState::kLost:
      return "lost";
  }
  return "?";
}

class CameraWorker::Impl {
 public:
  Impl(std::string camera, Factory make_camera, CameraWorkerOptions options)
      : name_(camera),
        options_(options),
        session_(std::move(camera), std::move(make_camera), std::move(options)),
        thread_([this] { run(); }) {}

  ~Impl() {
    end();
    thread_.join();
  }

  void end() {
    const std::lock_guard lock(mutex_);
    quit_ = true;
    changed_.notify_all();
  }

  const std::string& camera() const { return name_; }

  void arm(Duration period, bool edges_are_reported) {
    const std::lock_guard lock(mutex_);
    ask([=](CameraSession& session) { session.arm(period, edges_are_reported); });
    status_.frames = status_.suspect = dropped_ = 0;
    status_.last_pulse = -1;
    start_take(CameraState::kSettling);
  }

  void rejoin(Duration period, bool edges_are_reported, const CameraResumeState& past) {
    const std::lock_guard lock(mutex_);
    ask([=](CameraSession& session) { session.rejoin(period, edges_are_reported, past); });
    status_.frames = past.delivered;
    status_.suspect = past.suspect;
    dropped_ = 0;
    start_take(CameraState::kReady);
  }

  void pulse_at(const PulseEdge& edge) {
    const std::lock_guard lock(mutex_);
    // The first pulse is already known.
    if (status_.state == CameraState::kRunning && !status_.is_resuming) return;
    ask([edge](CameraSession& session) { session.pulse_at(edge); });
  }

  void train_ended() {
    const std::lock_guard lock(mutex_);
    ask([](CameraSession& session) { session.train_ended(); });
  }

  void disarm() {
    const std::lock_guard lock(mutex_);
    ask([](CameraSession& session) { session.disarm(); });
    start_take(CameraState::kIdle);
  }

  std::optional<Frame> pop(MonotonicInstant deadline) {
    std::unique_lock lock(mutex_);
    changed_.wait_for(lock, deadline - Monotonic::now(), [&] { return !queue_.empty(); });
    if (queue_.empty()) return {};
    Frame frame = std::move(queue_.front());
    queue_.pop_front();
    return frame;
  }

  CameraWorkerStatus status() const {
    const std::lock_guard lock(mutex_);
    CameraWorkerStatus status = status_;
    status.dropped = dropped_;
    return status;
  }

  int64_t waiting() const {
    const std::lock_guard lock(mutex_);
    return static_cast<int64_t>(queue_.size());
  }

 private:
  using Request = std::function<void(CameraSession&)>;

  void ask(Request request) {
    requests_.push_back(std::move(request));
    changed_.notify_all();
  }

  /// Starts a new take number and sets the state that status() reports until the thread has handled
  /// the request. So status() and pop() never return data of the previous take.
  void start_take(CameraState state) {
    ++take_;
    queue_.clear();
    const bool streaming =
        status_.state != CameraState::kOpening && status_.state != CameraState::kLost;
    if (streaming) status_.state = state;
  }

  void run() {
    std::unique_lock lock(mutex_);
    while (!quit_) {
      for (const Request& request : std::exchange(requests_, {})) request(session_);
      const int64_t take = take_;
      lock.unlock();
      auto frame = session_.step();
      const CameraWorkerStatus status = session_.status();
      lock.lock();
      if (take != take_) continue;  // the result of this step belongs to the previous take
      status_ = status;
      if (frame) deliver(std::move(*frame));
      const Duration idle = session_.idle_until() - options_.now();
      if (idle > Duration::zero()) {
        changed_.wait_for(lock, idle, [&] { return quit_ || !requests_.empty(); });
      }
    }
    // Closes the camera on this thread: so several cameras that no longer answer close in parallel.
    lock.unlock();
    session_.close();
  }

  void deliver(Frame frame) {
    if (queue_.size() >= options_.queue_frames) {
      queue_.pop_front();
      ++dropped_;
    }
    queue_.push_back(std::move(frame));
    changed_.notify_all();
  }

  const std::string name_;
  const CameraWorkerOptions options_;
  CameraSession session_;  ///< used by thread_ only

  mutable std::mutex mutex_;  ///< protects everything below
  std::condition_variable changed_;
  std::deque<Request> requests_;
  std::deque<Frame> queue_;
  CameraWorkerStatus status_;
  int64_t dropped_ = 0;
  int64_t take_ = 0;  ///< number of calls of arm(), rejoin() and disarm()
  bool quit_ = false;

  std::thread thread_;
};

CameraWorker::CameraWorker(std::string camera, Factory make_camera, CameraWorkerOptions options)
    : impl_(std::make_unique<Impl>(std::move(camera), std::move(make_camera), std::move(options))) {
}
CameraWorker::~CameraWorker() = default;
void CameraWorker::end() { impl_->end(); }
const std::string& CameraWorker::camera() const { return impl_->camera(); }
void CameraWorker::arm(Duration period, bool edges_are_reported) {
  impl_->arm(period, edges_are_reported);
}
void CameraWorker::rejoin(Duration period, bool edges_are_reported, const CameraResumeState& past) {
  impl_->rejoin(period, edges_are_reported, past);
}
void CameraWorker::pulse_at(const PulseEdge& edge) { impl_->pulse_at(edge); }
void CameraWorker::train_ended() { impl_->train_ended(); }
void CameraWorker::disarm() { impl_->disarm(); }
std::optional<Frame> CameraWorker::pop(MonotonicInstant deadline) { return impl_->pop(deadline); }
CameraWorkerStatus CameraWorker::status() const { return impl_->status(); }
int64_t CameraWorker::waiting() const { return impl_->waiting(); }

}  // namespace v3d::capture
