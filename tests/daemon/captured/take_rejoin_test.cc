#include "daemon/captured/take_rejoin.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <atomic>
#include <future>
#include <memory>
#include <stdexcept>
#include <thread>

#include "base/io/process.h"
#include "support/child_process.h"
#include "support/temporary_folder.h"

namespace v3d::captured {
namespace {

using testing::IsEmpty;

class ReaderOfARecordedTake : public testing::Test {
 protected:
  ReaderOfARecordedTake() {
    take::EventLogWriter pulses(take_.pulses());
    for (const std::string& camera : kCameras) {
      take::EventLogWriter frames(take_.frames(camera));
      for (int64_t pulse = 0; pulse < kFrames; ++pulse) {
        wire::FrameMessage message;
        message.frame.camera = camera;
        message.frame.label.pulse = pulse;
        message.frame.image = Image({16, 8}, PixelFormat::kMono8);
        EXPECT_TRUE(frames.write(message));
      }
    }
    for (const char* camera : {"cam01", "cam02", "cam03", "cam04"}) save_plates(camera);
    for (int64_t pulse = 0; pulse < kFrames; ++pulse) {
      wire::PulseMessage message;
      message.pulse = pulse;
      EXPECT_TRUE(pulses.write(message));
    }
  }

  void save_plates(const std::string& camera) const {
    const std::vector<float> mean(16 * 8, 100), spread(16 * 8, 1);
    segmentation::save_background(
        take_.background(), camera,
        {.size = {16, 8}, .format = PixelFormat::kMono8, .mean = mean, .spread = spread});
  }

  static constexpr int64_t kFrames = 5;
  const std::vector<std::string> kCameras = {"cam01", "cam02"};
  const test::TemporaryFolder folder_;
  const take::TakePaths take_{folder_.path()};
};

TEST_F(ReaderOfARecordedTake, returns_pulses_and_frames_without_waiting_for_the_disk) {
  std::promise<void> disk;
  const std::shared_future<void> disk_answers = disk.get_future().share();
  RecordedTakeReader reader(take_, kCameras, [disk_answers] { disk_answers.wait(); });
  EXPECT_FALSE(reader.is_done());
  disk.set_value();
  const RecordedTake recorded = reader.result();
  EXPECT_EQ(recorded.edges.size(), static_cast<size_t>(kFrames));
  EXPECT_THAT(recorded.problems, IsEmpty());
  ASSERT_EQ(recorded.cameras.size(), 2U);
  for (const auto& [camera, state] : recorded.cameras) {
    EXPECT_EQ(state.camera.delivered, kFrames);
    EXPECT_THAT(state.problems, IsEmpty());
    ASSERT_TRUE(state.log);
    EXPECT_EQ(state.log->events(), kFrames);
    EXPECT_EQ(recorded.segmenters.at(camera).size(), (ImageSize{16, 8}));
  }
}

TEST_F(ReaderOfARecordedTake, reports_a_log_that_cannot_be_read) {
  test::write_text(take_.frames("cam03"), std::string(1000, 'x'));
  const RecordedTake recorded = RecordedTakeReader(take_, {"cam03", "cam04"}).result();
  EXPECT_THAT(recorded.cameras.at("cam03").problems, testing::SizeIs(1));
  EXPECT_FALSE(recorded.cameras.at("cam03").log);
  EXPECT_THAT(recorded.cameras.at("cam04").problems, IsEmpty()) << "it has no log";
}

TEST_F(ReaderOfARecordedTake, ends_at_an_exception) {
  int reads = 0;
  RecordedTakeReader reader(take_, kCameras, [&] {
    ++reads;
    throw std::runtime_error("cancelled");
  });
  EXPECT_THROW(reader.result(), std::runtime_error);
  EXPECT_EQ(reads, 1);
}

TEST_F(ReaderOfARecordedTake, ends_after_the_next_read_when_it_is_destroyed) {
  std::promise<void> reads_first, disk;
  const std::shared_future<void> disk_answers = disk.get_future().share();
  std::atomic<int> reads = 0;
  auto reader = std::make_unique<RecordedTakeReader>(take_, kCameras, [&] {
    if (++reads > 1) return;
    reads_first.set_value();
    disk_answers.wait();
  });
  reads_first.get_future().wait();
  std::promise<pid_t> destroyer;
  std::thread destroying([&] {
    destroyer.set_value(gettid());
    reader.reset();
  });
  const pid_t thread = destroyer.get_future().get();
  EXPECT_TRUE(test::becomes_true([&] { return thread_sleeps(thread); }, test::within(30)));
  disk.set_value();
  destroying.join();
  EXPECT_EQ(reads, 1);
}

TEST_F(ReaderOfARecordedTake, can_be_ended_at_each_pulse) {
  int reads = 0;
  RecordedTakeReader(take_, {}, [&] { ++reads; }).result();
  EXPECT_GE(reads, kFrames);
}

}  // namespace
}  // namespace v3d::captured
