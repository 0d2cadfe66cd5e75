#include "v3dctl/import/import.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <csignal>
#include <cstdlib>
#include <fstream>

#include "base/config/calib_file.h"
#include "base/core/error.h"
#include "base/core/text.h"
#include "base/image/image_files.h"
#include "base/io/child_process.h"
#include "base/io/file.h"
#include "common/console.h"
#include "daemon/recorded/take_frames.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"
#include "take/ledger/verify.h"
#include "tools/test_images.h"

namespace v3d::ctl {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
namespace fs = std::filesystem;

class Import : public testing::Test {
 protected:
  Import() {
    save_calib(folder_ / "calib.toml", rig_);
    test::write_pictures(folder_ / "images", rig_, test::ball_image);
    test::write_pictures(folder_ / "masks", rig_, test::ball_mask);
    options_.take = folder_ / "take";
    options_.calib = folder_ / "calib.toml";
    options_.images = folder_ / "images";
  }

  void use_videos(int frames_a, int frames_b) {
    options_.images.clear();
    test::write_video(folder_ / "a.avi", {64, 48}, frames_a);
    test::write_video(folder_ / "b.avi", {64, 48}, frames_b);
    options_.videos = {{"a", folder_ / "a.avi"}, {"b", folder_ / "b.avi"}};
  }

  /// The message of a rejected import. No take and no temporary folder remain.
  std::string rejection() {
    try {
      import_take(options_);
    } catch (const InputError& error) {
      EXPECT_FALSE(fs::exists(options_.take));
      for (const auto& entry : fs::directory_iterator(folder_.path())) {
        EXPECT_THAT(entry.path().string(), testing::Not(HasSubstr("partial")));
      }
      EXPECT_THAT(error.what(), testing::Not(HasSubstr("\n")));
      return error.what();
    }
    ADD_FAILURE() << "was not rejected";
    return "";
  }

  test::TemporaryFolder folder_;
  Rig rig_ = test::small_rig(4);
  ImportOptions options_;
};

TEST_F(Import, makes_a_whole_take_of_images_and_masks) {
  options_.masks = folder_ / "masks";
  const ImportResult result = import_take(options_);
  EXPECT_EQ(result.frames, 1);
  EXPECT_TRUE(take::verify_take({options_.take}).whole());
}

TEST_F(Import, keeps_every_pixel_and_every_bit_of_the_mask) {
  options_.masks = folder_ / "masks";
  import_take(options_);
  recorded::TakeFrames take(options_.take, {});
  const auto frames = take.read(0);
  ASSERT_EQ(frames.size(), 4U);
  for (size_t i = 0; i < frames.size(); ++i) {
    ASSERT_TRUE(frames[i]);
    EXPECT_EQ(frames[i]->raw.image.bytes, test::ball_image(rig_[i]).bytes);
    const Image mask = test::ball_mask(rig_[i]);
    for (int y = 0; y < 48; ++y) {
      for (int x = 0; x < 64; ++x) {
        ASSERT_EQ(frames[i]->mask.get(x, y), mask.row(y)[3 * x] > 0);
      }
    }
  }
}

TEST_F(Import, reads_the_frames_of_one_folder_per_camera_in_numeric_order) {
  for (const RigCamera& camera : rig_) {
    fs::create_directories(folder_ / "frames" / camera.name);
    for (const char* name : {"10.png", "9.png", "8.png"}) {
      write_png(folder_ / "frames" / camera.name / name,
                Image({64, 48}, PixelFormat::kRGB8).view());
    }
    write_png(folder_ / "frames" / camera.name / "10.png", test::ball_image(camera).view());
  }
  options_.images = folder_ / "frames";
  options_.black = BlackBackground{0.1, 0, 0};
  EXPECT_EQ(import_take(options_).frames, 3);
  recorded::TakeFrames take(options_.take, {});
  EXPECT_EQ(take.read(0)[0]->mask.count(), 0);
  EXPECT_GT(take.read(2)[0]->mask.count(), 0);
}

TEST_F(Import, masks_what_is_brighter_than_a_black_background) {
  options_.black = BlackBackground{0.19, 0, 0};
  import_take(options_);
  recorded::TakeFrames take(options_.take, {});
  const Mask mask = take.read(0)[1]->mask;
  int64_t bright = 0;
  const Image image = test::ball_image(rig_[1]);
  for (size_t i = 0; i < image.bytes.size(); i += 3) bright += image.bytes[i] > 0;
  EXPECT_EQ(mask.count(), bright);
}

TEST_F(Import, dilates_a_mask_more_than_it_erodes_it_when_requested) {
  const Image image = test::ball_image(rig_[0]);
  const int64_t exact = mask_before_black(image.view(), {0.19, 0, 0}).count();
  EXPECT_GT(mask_before_black(image.view(), {0.19, 3, 1}).count(), exact);
  EXPECT_LT(mask_before_black(image.view(), {0.19, 0, 2}).count(), exact);
}

TEST_F(Import, rejects_sparse_files_that_are_longer_than_their_limits) {
  fs::resize_file(folder_ / "images" / "b.png", 300 << 20);
  EXPECT_THAT(rejection(), AllOf(HasSubstr("b.png"), HasSubstr("longer than")));
  fs::resize_file(folder_ / "calib.toml", 300 << 20);
  EXPECT_THAT(rejection(), AllOf(HasSubstr("calib.toml"), HasSubstr("longer than")));
}

TEST_F(Import, imports_videos_at_their_own_rate) {
  use_videos(7, 7);
  const ImportResult result = import_take(options_);
  EXPECT_EQ(result.frames, 7);
  EXPECT_DOUBLE_EQ(result.rate_hz, 10);
  EXPECT_TRUE(take::verify_take({options_.take}).whole());
}

TEST_F(Import, makes_a_take_that_is_not_read_with_a_calibration_of_another_size) {
  use_videos(3, 3);
  options_.backgrounds = options_.videos;
  import_take(options_);
  std::string calib = read_file(options_.take / "calib.toml");
  calib.replace(calib.find("[64, 48]"), 8, "[16384, 16384]");
  test::write_text(options_.take / "calib.toml", calib);
  EXPECT_THAT(test::message_of<InputError>([&] { recorded::TakeFrames take(options_.take, {}); }),
              HasSubstr("the size of a is 16384x16384, but its frames are 64x48"));
}

TEST_F(Import, learns_backgrounds_that_segment_the_frames) {
  use_videos(3, 3);
  options_.backgrounds = options_.videos;
  import_take(options_);
  recorded::TakeFrames take(options_.take, {});
  EXPECT_TRUE(take.read(0)[0]);
}

/// What an import with this background of camera a writes on stderr.
std::string errors_with_background(ImportOptions options, const fs::path& background) {
  options.backgrounds = {{"a", background}};
  testing::internal::CaptureStderr();
  import_take(options);
  return testing::internal::GetCapturedStderr();
}

TEST_F(Import, uses_at_most_100_plates_of_a_video_that_does_not_state_its_length) {
  test::write_jpeg(folder_ / "frame.jpg", test::ball_image(rig_[0]));
  const std::string jpeg = read_file(folder_ / "frame.jpg");
  std::string motion_jpeg;
  for (int frame = 0; frame < 150; ++frame) motion_jpeg += jpeg;
  replace_file(folder_ / "empty.mjpeg", motion_jpeg);
  EXPECT_THAT(errors_with_background(options_, folder_ / "empty.mjpeg"),
              HasSubstr("background of a: 75 plates"));
}

TEST_F(Import, uses_at_most_100_plates_of_a_folder) {
  fs::create_directory(folder_ / "empty");
  for (int image = 0; image < 101; ++image) {
    fs::copy_file(folder_ / "images/a.png", folder_ / "empty" / (std::to_string(image) + ".png"));
  }
  EXPECT_THAT(errors_with_background(options_, folder_ / "empty"),
              HasSubstr("background of a: 51 plates"));
}

TEST_F(Import, imports_a_part_of_videos_of_unequal_length) {
  use_videos(7, 5);
  options_.frames = {1, 5};
  EXPECT_EQ(import_take(options_).frames, 4);
}

TEST_F(Import, rejects_a_video_that_ends_early_and_reports_the_length_of_each) {
  use_videos(7, 5);
  EXPECT_THAT(rejection(), AllOf(HasSubstr("a 7, b 5 frames"), HasSubstr("--frames 0:5")));
}

TEST_F(Import, rejects_a_truncated_video_file) {
  use_videos(60, 60);
  test::truncate_file(folder_ / "b.avi", 0.7);
  EXPECT_THAT(rejection(), HasSubstr("b.avi: cannot be decoded near frame "));
}

TEST_F(Import, rejects_a_file_that_is_not_a_video) {
  use_videos(3, 3);
  std::ofstream(folder_ / "b.avi") << "no video at all";
  EXPECT_THAT(rejection(), AllOf(HasSubstr("b.avi"), HasSubstr("no readable video")));
}

/// Fills the data of one frame of an AVI file with zeros, without a change of its length.
void destroy_frame(const fs::path& avi, int frame) {
  std::string bytes = read_file(avi);
  size_t at = bytes.find("movi");
  for (int n = 0; n <= frame; ++n) at = bytes.find("00dc", at + 4);
  const size_t end = bytes.find("00dc", at + 4);
  std::fill(bytes.begin() + at + 8, bytes.begin() + end, '\0');
  replace_file(avi, bytes);
}

TEST_F(Import, rejects_a_video_with_a_frame_that_cannot_be_decoded) {
  use_videos(7, 7);
  destroy_frame(folder_ / "b.avi", 3);
  const std::string line =
      (folder_ / "b.avi").string() + ": cannot be decoded near frame 3, 0.300 s";
  EXPECT_THAT(rejection(), HasSubstr(line));
  options_.frames = {4, 6};
  EXPECT_THAT(rejection(), AllOf(HasSubstr(line), HasSubstr("; --frames 0:3 selects the frames")))
      << "frames are numbered from the beginning";
  options_.frames = {0, 3};
  EXPECT_EQ(import_take(options_).frames, 3);
}

using ImportDeathTest = Import;

TEST_F(ImportDeathTest, ends_after_an_interrupt_while_it_passes_over_frames) {
  GTEST_FLAG_SET(death_test_style, "threadsafe");  // the decoder has threads
  use_videos(7, 7);
  destroy_frame(folder_ / "b.avi", 3);  // must not be reached
  options_.frames = {4, 6};
  const auto exit_after_interrupt = [&] {
    catch_interrupts();
    std::raise(SIGINT);
    const std::string message =
        test::message_of<std::runtime_error>([&] { import_take(options_); });
    std::_Exit(message == "interrupted" ? 7 : 0);
  };
  EXPECT_EXIT(exit_after_interrupt(), testing::ExitedWithCode(7), "");
}

/// Converts a video with options of ffmpeg.
void convert(const fs::path& from, const fs::path& to, const std::vector<std::string>& options) {
  std::vector<std::string> command = {"ffmpeg", "-loglevel", "error", "-i", from.string()};
  command.insert(command.end(), options.begin(), options.end());
  command.push_back(to.string());
  ASSERT_EQ(run_process(command, Output::kShow).status, 0);
}

TEST_F(Import, rejects_a_video_with_a_missing_frame) {
  if (!has_program("ffmpeg")) GTEST_SKIP() << "there is no ffmpeg";
  use_videos(6, 7);
  convert(folder_ / "b.avi", folder_ / "b.mkv",
          {"-vf", "select='not(eq(n,3))'", "-vsync", "vfr", "-c:v", "mjpeg"});
  options_.videos[1].second = folder_ / "b.mkv";
  const std::string line =
      "b.mkv frame 3: is 0.200 s after the frame before, but earlier frames "
      "are 0.100 s apart: frames are missing";
  EXPECT_THAT(rejection(), HasSubstr(line));
  options_.frames = {4, 6};
  EXPECT_THAT(rejection(), HasSubstr(line)) << "frames are numbered from the beginning";
  options_.frames = {0, 3};
  EXPECT_EQ(import_take(options_).frames, 3);
}

TEST_F(Import, accepts_videos_whose_times_are_rounded_to_milliseconds) {
  if (!has_program("ffmpeg")) GTEST_SKIP() << "there is no ffmpeg";
  use_videos(20, 20);
  for (auto& [camera, video] : options_.videos) {
    test::write_video(video, {64, 48}, 20, 30);
    const fs::path rounded = folder_ / (camera + ".mkv");
    convert(video, rounded, {"-c:v", "copy"});
    video = rounded;
  }
  const ImportResult result = import_take(options_);
  EXPECT_EQ(result.frames, 20);
  EXPECT_DOUBLE_EQ(result.rate_hz, 30);
}

TEST_F(Import, rejects_a_video_that_ends_within_a_frame) {
  use_videos(5, 5);
  std::string motion_jpeg;
  for (const int64_t bytes : {1'000'000, 1'000'000, 400}) {
    test::write_jpeg(folder_ / "frame.jpg", Image({64, 48}, PixelFormat::kRGB8));
    motion_jpeg += read_file(folder_ / "frame.jpg").substr(0, bytes);
  }
  replace_file(folder_ / "b.mjpeg", motion_jpeg);
  options_.videos[1].second = folder_ / "b.mjpeg";
  options_.rate_hz = 25;
  EXPECT_THAT(rejection(), HasSubstr("b.mjpeg: cannot be decoded near frame 2"));
}

TEST_F(Import, rejects_a_video_whose_picture_size_changes_in_the_middle) {
  use_videos(5, 5);
  std::string motion_jpeg;
  for (const ImageSize size : {ImageSize{64, 48}, {64, 48}, {64, 48}, {32, 24}, {64, 48}}) {
    test::write_jpeg(folder_ / "frame.jpg", Image(size, PixelFormat::kRGB8));
    motion_jpeg += read_file(folder_ / "frame.jpg");
  }
  replace_file(folder_ / "b.mjpeg", motion_jpeg);
  options_.videos[1].second = folder_ / "b.mjpeg";
  options_.rate_hz = 25;
  EXPECT_THAT(rejection(), HasSubstr((folder_ / "b.mjpeg").string() +
                                     " frame 3: is 32x24, but the frames before are 64x48"));
  options_.frames = {4, 5};
  EXPECT_THAT(rejection(), HasSubstr("b.mjpeg frame 3: is 32x24"))
      << "also where it is passed over";
  options_.frames = {0, 3};
  EXPECT_EQ(import_take(options_).frames, 3);
}

TEST_F(Import, rejects_a_video_that_is_a_folder_a_fifo_empty_or_missing) {
  use_videos(3, 3);
  fs::create_directory(folder_ / "folder.avi");
  replace_file(folder_ / "empty.avi", "");
  ASSERT_EQ(mkfifo((folder_ / "fifo.avi").c_str(), 0644), 0);
  for (const auto& [name, line] : {std::pair("folder.avi", "it is not a regular file"),
                                   {"fifo.avi", "it is not a regular file"},
                                   {"empty.avi", "no readable video"},
                                   {"none.avi", "No such file"}}) {
    options_.videos[1].second = folder_ / name;
    EXPECT_THAT(rejection(), AllOf(HasSubstr(name), HasSubstr(line)));
  }
}

TEST_F(Import, rejects_videos_of_different_rates_without_a_given_rate) {
  use_videos(3, 3);
  test::write_video(folder_ / "b.avi", {64, 48}, 3, 30);
  EXPECT_THAT(rejection(), AllOf(HasSubstr("30"), HasSubstr("--rate")));
  options_.rate_hz = 50;
  EXPECT_DOUBLE_EQ(import_take(options_).rate_hz, 50);
}

TEST_F(Import, rejects_videos_of_30_and_29_97_frames_a_second_without_a_given_rate) {
  use_videos(3, 3);
  test::write_video(folder_ / "a.avi", {64, 48}, 3, 30);
  test::write_video(folder_ / "b.avi", {64, 48}, 3, 30000.0 / 1001);
  EXPECT_THAT(rejection(),
              AllOf(HasSubstr("has 29.97"), HasSubstr("has 30.0"), HasSubstr("--rate")));
}

TEST_F(Import, rejects_a_part_that_the_recordings_do_not_have) {
  use_videos(3, 3);
  options_.frames = {5, 8};
  EXPECT_THAT(rejection(), HasSubstr("end after 3 frames"));
}

TEST_F(Import, rejects_a_calibration_with_a_missing_field) {
  const std::string whole = read_file(options_.calib);
  const size_t line = whole.find("translation");
  replace_file(options_.calib, whole.substr(0, line) + whole.substr(whole.find('\n', line)));
  EXPECT_THAT(rejection(), AllOf(HasSubstr("calib.toml"), HasSubstr("translation")));
}

TEST_F(Import, rejects_two_cameras_of_one_name) {
  rig_[1].name = "a";
  save_calib(options_.calib, rig_);
  EXPECT_THAT(rejection(), HasSubstr("calib.toml"));
}

TEST_F(Import, rejects_a_camera_whose_name_does_not_fit_in_the_channel_of_its_log) {
  const std::string name(kMaxCameraName + 1, 'c');
  fs::rename(folder_ / "images" / (rig_[0].name + ".png"), folder_ / "images" / (name + ".png"));
  rig_[0].name = name;
  save_calib(folder_ / "calib.toml", rig_);
  EXPECT_THAT(rejection(), HasSubstr("its name has 52 characters; expected at most 51"));
}

TEST_F(Import, rejects_a_rotated_image) {
  write_png(folder_ / "images/c.png", Image({48, 64}, PixelFormat::kRGB8).view());
  EXPECT_THAT(rejection(), AllOf(HasSubstr("c.png"), HasSubstr("48x64"), HasSubstr("64x48"),
                                 HasSubstr("rotated")));
}

TEST_F(Import, rejects_a_truncated_image) {
  test::truncate_file(folder_ / "images/c.png", 0.6);
  EXPECT_THAT(rejection(), AllOf(HasSubstr("c.png"), HasSubstr("truncated")));
}

TEST_F(Import, rejects_a_truncated_jpeg_which_its_library_would_fill_with_grey) {
  fs::rename(folder_ / "images/c.png", folder_ / "c.png");
  test::write_jpeg(folder_ / "images/c.jpg", test::ball_image(rig_[2]));
  import_take(options_);
  fs::remove_all(options_.take);
  test::truncate_file(folder_ / "images/c.jpg", 0.7);
  EXPECT_THAT(rejection(), AllOf(HasSubstr("c.jpg"), HasSubstr("truncated")));
}

TEST_F(Import, rejects_an_empty_image_file) {
  test::truncate_file(folder_ / "images/c.png", 0);
  EXPECT_THAT(rejection(), HasSubstr("c.png"));
}

TEST_F(Import, rejects_a_mask_of_another_size_than_its_image) {
  options_.masks = folder_ / "masks";
  write_png(folder_ / "masks/b.png", Image({32, 24}, PixelFormat::kRGB8).view());
  EXPECT_THAT(rejection(), AllOf(HasSubstr("masks/b.png"), HasSubstr("32x24")));
}

TEST_F(Import, rejects_an_image_without_its_mask) {
  options_.masks = folder_ / "masks";
  fs::remove(folder_ / "masks/b.png");
  EXPECT_THAT(rejection(), AllOf(HasSubstr("no mask"), HasSubstr("images/b.png")));
}

TEST_F(Import, rejects_a_mask_without_its_image) {
  options_.masks = folder_ / "masks";
  fs::remove(folder_ / "images/b.png");
  EXPECT_THAT(rejection(), AllOf(HasSubstr("masks/b.png"), HasSubstr("without an image")));
}

TEST_F(Import, rejects_an_image_of_an_unknown_camera) {
  write_png(folder_ / "images/zoe.png", test::ball_image(rig_[0]).view());
  EXPECT_THAT(rejection(), AllOf(HasSubstr("zoe.png"), HasSubstr("a, b, c, d")));
}

TEST_F(Import, rejects_an_unknown_camera_in_video_and_in_background) {
  use_videos(3, 3);
  options_.videos[1].first = "zoe";
  EXPECT_THAT(rejection(), AllOf(HasSubstr("--video zoe"), HasSubstr("calib.toml")));
  options_.videos[1].first = "b";
  options_.backgrounds = {{"zoe", folder_ / "a.avi"}};
  EXPECT_THAT(rejection(), HasSubstr("--background zoe"));
}

TEST_F(Import, rejects_two_pictures_of_one_camera_and_frame) {
  test::write_jpeg(folder_ / "images/a.jpg", test::ball_image(rig_[0]));
  EXPECT_THAT(rejection(), AllOf(HasSubstr("a.jpg"), HasSubstr("a.png")));
}

TEST_F(Import, rejects_cameras_that_have_different_frames) {
  for (const char* file : {"a/1.png", "a/2.png", "b/1.png", "b/3.png"}) {
    fs::create_directories((folder_ / "frames" / file).parent_path());
    write_png(folder_ / "frames" / file, test::ball_image(rig_[0]).view());
  }
  options_.images = folder_ / "frames";
  EXPECT_THAT(rejection(), AllOf(HasSubstr("frames differ"), HasSubstr("2.png")));
}

TEST_F(Import, rejects_a_folder_without_images) {
  options_.images = folder_ / "empty";
  fs::create_directories(options_.images);
  EXPECT_THAT(rejection(), AllOf(HasSubstr("empty"), HasSubstr("no images")));
  options_.images = folder_ / "not there";
  EXPECT_THAT(rejection(), HasSubstr("not there"));
}

TEST_F(Import, rejects_to_overwrite_a_take) {
  import_take(options_);
  EXPECT_THROW(import_take(options_), InputError);
  EXPECT_TRUE(take::verify_take({options_.take}).whole());
}

TEST_F(Import, rejects_an_invalid_take_name) {
  options_.take = folder_ / "my take";
  EXPECT_THAT(rejection(), HasSubstr("no take name"));
}

TEST_F(Import, rejects_neither_images_nor_videos_and_both) {
  options_.videos = {{"a", folder_ / "a.avi"}};
  EXPECT_THAT(rejection(), HasSubstr("either --images"));
  options_.videos.clear();
  options_.images.clear();
  EXPECT_THAT(rejection(), HasSubstr("either --images"));
}

TEST(BlackBackgroundOption, reads_a_level_and_the_pixels_to_dilate_and_erode) {
  EXPECT_DOUBLE_EQ(parse_black_background("0.19").level, 0.19);
  const BlackBackground black = parse_black_background("0.5:10:7");
  EXPECT_DOUBLE_EQ(black.level, 0.5);
  EXPECT_EQ(black.dilate_px, 10);
  EXPECT_EQ(black.erode_px, 7);
}

TEST(BlackBackgroundOption, rejects_an_invalid_level) {
  for (const char* text : {"", "dark", "1.5", "-0.1", "nan", "0.2:3", "0.2:3:", "0.2:3:4:5",
                           "0.2:-1:0", "0.2:1000:0"}) {
    EXPECT_THROW(parse_black_background(text), InputError) << text;
  }
}

}  // namespace
}  // namespace v3d::ctl
