#include "capture/cameras/camera_worker.h"

#include <gtest/gtest.h>

#include <vector>

#include "base/core/error.h"
#include "capture/fed_camera.h"

namespace v3d::capture {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

class CameraWorkerTest : public testing::Test {
 protected:
  std::unique_ptr<CameraWorker> worker(size_t queue_frames) {
    CameraWorkerOptions options;
    options.queue_frames = queue_frames;
    options.reopen_after = std::chrono::hours(1);
    return std::make_unique<CameraWorker>(
        "cam07", [h = source_] { return std::make_unique<FedCamera>(h); }, options);
  }
  bool ready(CameraWorker& worker) {
    worker.arm(milliseconds(1));
    return eventually([&] { return worker.status().state == CameraState::kReady; });
  }

  std::shared_ptr<FrameSource> source_ = std::make_shared<FrameSource>();
};

TEST_F(CameraWorkerTest, delivers_labelled_frames_in_order) {
  const auto w = worker(16);
  ASSERT_TRUE(ready(*w));
  for (int64_t pulse = 0; pulse < 100; ++pulse) {
    source_->expose();
    const auto frame = w->pop(Monotonic::now() + seconds(20));
    ASSERT_TRUE(frame);
    EXPECT_EQ(frame->label.pulse, pulse);
  }
  EXPECT_FALSE(w->pop(Monotonic::now()));
  EXPECT_EQ(w->status().dropped, 0);
}

TEST_F(CameraWorkerTest, drops_the_oldest_frames_of_a_full_queue_and_counts_them) {
  const auto w = worker(4);
  ASSERT_TRUE(ready(*w));
  for (int i = 0; i < 10; ++i) source_->expose();
  ASSERT_TRUE(eventually([&] { return w->status().frames == 10; }));
  EXPECT_EQ(w->status().dropped, 6);
  for (int64_t pulse = 6; pulse < 10; ++pulse) {
    EXPECT_EQ(w->pop(Monotonic::now() + seconds(20))->label.pulse, pulse);
  }
}

TEST_F(CameraWorkerTest, discards_the_previous_take_when_it_is_armed_again) {
  const auto w = worker(16);
  for (int take = 0; take < 5; ++take) {
    ASSERT_TRUE(ready(*w));
    EXPECT_EQ(w->status().frames, 0);
    source_->expose();
    const auto frame = w->pop(Monotonic::now() + seconds(20));
    ASSERT_TRUE(frame);
    EXPECT_EQ(frame->label.pulse, 0);
    source_->expose();
    ASSERT_TRUE(eventually([&] { return w->status().frames == 2; }));
  }
}

TEST_F(CameraWorkerTest, keeps_frames_that_arrive_while_the_train_ends) {
  const auto w = worker(1000);
  ASSERT_TRUE(ready(*w));
  for (int i = 0; i < 500; ++i) {
    source_->expose();
    if (i % 10 == 0) w->train_ended();
  }
  ASSERT_TRUE(eventually([&] { return w->status().frames == 500; }));
  for (int64_t pulse = 0; pulse < 500; ++pulse) {
    ASSERT_EQ(w->pop(Monotonic::now() + seconds(20))->label.pulse, pulse);
  }
}

TEST_F(CameraWorkerTest, reports_the_error_of_the_factory_in_its_text) {
  const CameraWorker w(
      "cam07", []() -> std::unique_ptr<Camera> { throw InputError("camera cam07: no such kind"); });
  EXPECT_TRUE(eventually([&] { return w.status().text == "camera cam07: no such kind"; }));
  EXPECT_EQ(w.status().state, CameraState::kOpening);
}

TEST_F(CameraWorkerTest, ends_at_any_time_and_closes_its_camera) {
  const MonotonicInstant begin = Monotonic::now();
  for (int i = 0; i < 50; ++i) {
    const auto w = worker(4);
    if (i % 3 > 0) w->arm(milliseconds(1));
    if (i % 3 > 1) source_->expose();
  }
  EXPECT_EQ(source_.use_count(), 1) << "a camera or its factory still exists";
  EXPECT_LT(Monotonic::now() - begin, seconds(20))
      << "a worker waited for a frame or for reopening";
}

/// State of cameras whose destructors wait for each other, at most 10 s.
struct Closing {
  std::mutex mutex;
  std::condition_variable changed;
  int cameras = 0;       ///< cameras that are being closed
  bool together = true;  ///< all cameras closed in parallel
};

class SlowlyClosedCamera : public FedCamera {
 public:
  static constexpr int kCameras = 3;

  SlowlyClosedCamera(std::shared_ptr<FrameSource> source, Closing& closing)
      : FedCamera(std::move(source)), closing_(closing) {}
  ~SlowlyClosedCamera() override {
    std::unique_lock lock(closing_.mutex);
    ++closing_.cameras;
    closing_.changed.notify_all();
    if (!closing_.changed.wait_for(lock, seconds(10),
                                   [&] { return closing_.cameras == kCameras; })) {
      closing_.together = false;
    }
  }

 private:
  Closing& closing_;
};

TEST_F(CameraWorkerTest, close_their_cameras_in_parallel_after_end) {
  Closing closing;
  std::vector<std::unique_ptr<CameraWorker>> workers;
  for (int i = 0; i < SlowlyClosedCamera::kCameras; ++i) {
    workers.push_back(std::make_unique<CameraWorker>(
        "cam07", [&] { return std::make_unique<SlowlyClosedCamera>(source_, closing); }));
    ASSERT_TRUE(eventually([&] { return workers[i]->status().state == CameraState::kIdle; }));
  }
  for (const auto& worker : workers) worker->end();
  workers.clear();
  EXPECT_TRUE(closing.together);
}

}  // namespace
}  // namespace v3d::capture
