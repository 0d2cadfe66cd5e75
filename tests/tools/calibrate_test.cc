#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>

#include "calibrate/calibration_images.h"
#include "calibrate/rig_boards.h"
#include "support/temporary_folder.h"
#include "take/logs/frame_log.h"
#include "take/take.h"
#include "tools/test_images.h"

namespace v3d::calibrate {
namespace {

class RigImages : public testing::Test {
 protected:
  static constexpr ImageSize kSize{32, 16};

  void write_frames(const std::string& camera, int64_t pulses) {
    take::EventLogWriter log(take_.frames(camera));
    for (int64_t pulse = 0; pulse < pulses; ++pulse) {
      wire::FrameMessage message;
      message.frame.camera = camera;
      message.frame.label.pulse = pulse;
      message.frame.image = Image(kSize, PixelFormat::kMono8);
      message.frame.sensor_size = kSize;
      message.frame.roi = {0, 0, kSize.width, kSize.height};
      ASSERT_TRUE(log.write(message));
    }
  }

  /// The numbers of the images that are searched, by camera.
  static std::vector<std::set<int64_t>> numbers(const RigSources& sources) {
    std::vector<std::set<int64_t>> numbers;
    for (NamedSource& named : open_sources(sources)) {
      numbers.emplace_back();
      while (const auto image = named.source.next()) numbers.back().insert(image->number);
    }
    return numbers;
  }

  const test::TemporaryFolder folder_;
  const take::TakePaths take_{folder_ / "take"};
};

const std::set<int64_t> kEveryThird = {0, 3, 6, 9, 12, 15, 18};

TEST_F(RigImages, of_videos_of_different_lengths_have_the_same_numbers) {
  test::write_video(folder_ / "a.avi", kSize, 20);
  test::write_video(folder_ / "b.avi", kSize, 21);
  RigSources sources;
  sources.videos = {{"a", folder_ / "a.avi"}, {"b", folder_ / "b.avi"}};
  sources.sampling.max_images = 10;
  EXPECT_THAT(numbers(sources), testing::Each(kEveryThird));
}

TEST_F(RigImages, of_a_take_in_which_a_camera_stopped_have_the_same_numbers) {
  std::filesystem::create_directory(take_.folder);
  take::TakeInfo info;
  info.name = "take";
  info.rate_hz = 25;
  info.cameras = {"a", "b"};
  ASSERT_TRUE(save_take_info(take_, info));
  write_frames("a", 20);
  write_frames("b", 21);
  RigSources sources;
  sources.take = take_.folder;
  sources.sampling.max_images = 10;
  EXPECT_THAT(numbers(sources), testing::Each(kEveryThird));
}

}  // namespace
}  // namespace v3d::calibrate
