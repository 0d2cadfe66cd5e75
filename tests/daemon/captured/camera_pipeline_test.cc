// A pipeline that continues the log of its camera after a restart, while each read of the log takes
// as long as the period of the pulses; and one on a full disk.
#include <dlfcn.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <atomic>
#include <filesystem>

#include "capture/fed_camera.h"
#include "daemon/captured/node_take.h"
#include "support/file_size_limit.h"
#include "support/temporary_folder.h"

namespace v3d::test {
namespace {

/// Exposes a frame in each read of a frame log, and waits until it is in the camera's queue.
struct SlowReads {
  std::shared_ptr<capture::FrameSource> source;
  capture::CameraWorker& worker;
  int64_t known;  ///< frames of the camera before
  int64_t left;   ///< frames to expose

  void read() {
    if (left == 0) return;
    --left;
    source->expose();
    ++known;
    EXPECT_TRUE(capture::eventually([&] { return worker.status().frames == known; }));
  }
};

std::atomic<SlowReads*> slow_reads = nullptr;

}  // namespace
}  // namespace v3d::test

/// Replaces pread() of the C library in this program.
extern "C" ssize_t pread(int fd, void* bytes, size_t size, off_t offset) {
  static auto* const next =
      reinterpret_cast<ssize_t (*)(int, void*, size_t, off_t)>(dlsym(RTLD_NEXT, "pread"));
  if (v3d::test::SlowReads* const reads = v3d::test::slow_reads) {
    const auto file = std::filesystem::read_symlink("/proc/self/fd/" + std::to_string(fd));
    if (file.extension() == ".lcmlog") reads->read();
  }
  return next(fd, bytes, size, offset);
}

namespace v3d::captured {
namespace {

constexpr char kUrl[] = "udpm://239.255.76.67:7667?ttl=0";
constexpr char kCamera[] = "cam07";
constexpr ImageSize kSize{64, 48};
constexpr int64_t kEarlier = 100;  ///< frames of before the restart
constexpr int64_t kNew = 64;       ///< frames that arrive while the logs are read

wire::FrameMessage earlier_frame(int64_t pulse) {
  wire::FrameMessage message;
  message.take = "kendo-07";
  message.frame.camera = kCamera;
  message.frame.label = {.pulse = pulse,
                         .camera_counter = static_cast<uint64_t>(pulse),
                         .device_time = from_ns<DeviceClock>(pulse * 1'000'000),
                         .received = Realtime::now()};
  message.frame.sensor_size = kSize;
  message.frame.roi = {0, 0, kSize.width, kSize.height};
  message.frame.image = Image(kSize, PixelFormat::kMono8);
  return message;
}

segmentation::Segmenter segmenter() {
  const std::vector<float> mean(kSize.width * kSize.height, 0), spread(mean.size(), 1);
  return {{.size = kSize, .format = PixelFormat::kMono8, .mean = mean, .spread = spread}, {}};
}

TEST(CameraPipelineAfterARestart, writes_every_frame_that_arrives_while_it_reads_its_log) {
  const test::TemporaryFolder folder;
  const take::TakePaths take{folder.path()};
  {
    take::EventLogWriter log(take.frames(kCamera));
    for (int64_t n = 0; n < kEarlier; ++n) ASSERT_TRUE(log.write(earlier_frame(n)));
  }
  const auto source = std::make_shared<capture::FrameSource>();
  source->size = kSize;
  source->counter = kEarlier - 1;
  capture::CameraWorker worker(kCamera,
                               [source] { return std::make_unique<capture::FedCamera>(source); },
                               {.queue_frames = 4, .reopen_after = std::chrono::hours(1)});
  ASSERT_TRUE(
      capture::eventually([&] { return worker.status().state == capture::CameraState::kIdle; }));
  ResumeState state = read_resume_state(take, kCamera, {});
  worker.rejoin(std::chrono::milliseconds(1), false, state.camera);
  ASSERT_TRUE(capture::eventually([&] { return worker.status().last_pulse == kEarlier - 1; }));

  bus::Bus bus(kUrl);
  PrioritySemaphore slots(1);
  LiveAdmission admission([] { return 0; }, 5);
  test::SlowReads reads{.source = source, .worker = worker, .known = kEarlier, .left = kNew};
  test::slow_reads = &reads;
  CameraPipeline pipeline(worker,
                          {.take = "kendo-07",
                           .log = take.frames(kCamera),
                           .segmenter = segmenter(),
                           .rate_hz = 50,
                           .resume = std::move(state)},
                          {bus, slots, admission});
  EXPECT_TRUE(capture::eventually([&] { return pipeline.counts().written == kEarlier + kNew; }));
  EXPECT_EQ(worker.status().dropped, 0);
  test::slow_reads = nullptr;
  pipeline.close(kEarlier + kNew);
  EXPECT_EQ(std::ssize(take::FrameLogReader(take.frames(kCamera)).labels()), kEarlier + kNew);
}

TEST(CameraPipelineOnAFullDisk, ends_its_log_with_the_bytes_of_the_frame_that_did_not_fit) {
  const test::TemporaryFolder folder;
  const take::TakePaths take{folder.path()};
  const auto source = std::make_shared<capture::FrameSource>();
  source->size = kSize;
  capture::CameraWorker worker(kCamera,
                               [source] { return std::make_unique<capture::FedCamera>(source); },
                               {.queue_frames = 4, .reopen_after = std::chrono::hours(1)});
  const auto becomes = [&](capture::CameraState state) {
    return capture::eventually([&] { return worker.status().state == state; });
  };
  ASSERT_TRUE(becomes(capture::CameraState::kIdle));
  worker.arm(std::chrono::milliseconds(1));
  ASSERT_TRUE(becomes(capture::CameraState::kReady));
  bus::Bus bus(kUrl);
  PrioritySemaphore slots(1);
  LiveAdmission admission([] { return 0; }, 5);
  CameraPipeline pipeline(
      worker,
      {.take = "kendo-07", .log = take.frames(kCamera), .segmenter = segmenter(), .rate_hz = 50},
      {bus, slots, admission});
  source->expose();
  ASSERT_TRUE(capture::eventually([&] { return pipeline.counts().written == 1; }));
  const auto one_frame = std::filesystem::file_size(take.frames(kCamera));
  {
    const test::FileSizeLimit limit(one_frame + 100);
    source->expose();
    ASSERT_TRUE(capture::eventually([&] { return pipeline.counts().write_errors == 1; }));
  }
  pipeline.close(2);
  EXPECT_EQ(pipeline.file().bytes, static_cast<int64_t>(one_frame) + 100);
  EXPECT_EQ(pipeline.file().checksum,
            read_take_file(take, "cam07.lcmlog", take::ReadFrom::kPageCache)->checksum);
  pipeline.save_index();
  const take::FrameLogReader log(take.frames(kCamera));
  EXPECT_EQ(log.labels().size(), 1U);
  EXPECT_EQ(log.torn_bytes(), 0);
}

}  // namespace
}  // namespace v3d::captured
