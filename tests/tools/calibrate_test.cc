#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <csignal>
#include <cstdlib>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>
#include <random>
#include <set>

#include "base/config/calib_file.h"
#include "base/core/error.h"
#include "base/core/text.h"
#include "base/image/image_files.h"
#include "base/io/file.h"
#include "calib/boards/board.h"
#include "calibrate/calibrate_commands.h"
#include "calibrate/calibration_images.h"
#include "calibrate/colour_samples.h"
#include "calibrate/rig_boards.h"
#include "capture/segmentation/background.h"
#include "common/console.h"
#include "support/drawn_board.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"
#include "take/logs/frame_log.h"
#include "take/take.h"
#include "tools/command_outcome.h"
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

TEST_F(RigImages, of_a_long_take_are_in_runs_of_consecutive_pulses_for_time_offsets) {
  test::write_video(folder_ / "a.avi", kSize, 40);
  test::write_video(folder_ / "b.avi", kSize, 38);
  RigSources sources;
  sources.videos = {{"a", folder_ / "a.avi"}, {"b", folder_ / "b.avi"}};
  sources.sampling = {.max_images = 20, .run = 6};
  const std::set<int64_t> runs = {0,  1,  2,  3,  4,  5,  12, 13, 14, 15, 16,
                                  17, 24, 25, 26, 27, 28, 29, 36, 37, 38, 39};
  const auto found = numbers(sources);
  EXPECT_EQ(found.at(0), runs);
  EXPECT_THAT(found.at(1), testing::IsSubsetOf(runs));
}

/// A video of a board of 9x6 corners that does not move.
void write_board_video(const std::filesystem::path& path, int frames) {
  std::mt19937 random(1);
  cv::Mat picture;
  cv::cvtColor(test::drawn_board({}, random).grey, picture, cv::COLOR_GRAY2BGR);
  cv::VideoWriter video(path.string(), cv::CAP_FFMPEG, cv::VideoWriter::fourcc('M', 'J', 'P', 'G'),
                        10, picture.size());
  for (int i = 0; i < frames; ++i) video.write(picture);
}

TEST_F(RigImages, at_an_interval_have_the_instants_of_their_time_stamps) {
  // The first three frames have no instant.
  std::string stamps = "sync_index,cam_id,frame_index\n";
  for (int frame = 3; frame < 12; ++frame) {
    stamps += std::to_string(100 + frame) + ",cam1," + std::to_string(frame) + "\n";
  }
  replace_file(folder_ / "stamps.csv", stamps);
  write_board_video(folder_ / "cam1.avi", 12);
  RigSources sources;
  sources.videos = {{"cam1", folder_ / "cam1.avi"}};
  sources.time_stamps = folder_ / "stamps.csv";
  sources.sampling.every = 2;
  const calib::BoardDetector detector(calib::parse_board("chess:9x6:25mm"));
  const RigBoards boards = find_rig_boards(sources, detector);
  std::vector<int64_t> instants;
  for (const auto& [instant, observation] : boards.cameras.at(0).observations) {
    instants.push_back(instant);
  }
  EXPECT_THAT(instants, testing::ElementsAre(104, 106, 108, 110));
}

TEST_F(RigImages, of_a_camera_that_is_late_have_the_remedy_of_their_source) {
  using testing::HasSubstr;
  RigSources videos, take, images;
  videos.videos = {{"a", "a.avi"}};
  EXPECT_THAT(time_offset_remedy(videos), HasSubstr("use --timestamps"));
  videos.time_stamps = "stamps.csv";
  EXPECT_THAT(time_offset_remedy(videos), HasSubstr("check the time stamps of stamps.csv"));
  take.take = "boards-01";
  EXPECT_THAT(time_offset_remedy(take), HasSubstr("v3dctl verify boards-01"));
  images.images = {{"a", "a*.png"}};
  EXPECT_THAT(time_offset_remedy(images), HasSubstr("the n-th images"));
}

/// A source of these images, "image 0" and so on.
ImageSource source_of(std::vector<Image> images) {
  ImageSource source{"images", std::ssize(images), {}};
  source.next = [images = std::move(images),
                 position = size_t{0}]() mutable -> std::optional<CalibrationImage> {
    if (position == images.size()) return std::nullopt;
    const size_t number = position++;
    return CalibrationImage{static_cast<int64_t>(number), "image " + std::to_string(number),
                            images[number]};
  };
  return source;
}

Image grey_image(ImageSize size, uint8_t value) {
  Image image(size, PixelFormat::kMono8);
  std::fill(image.bytes.begin(), image.bytes.end(), value);
  return image;
}

/// A chessboard from the front, with a margin of one square.
Image chessboard(int corner_columns, int corner_rows) {
  constexpr int kSquare = 30;  // pixels
  Image image = grey_image({(corner_columns + 3) * kSquare, (corner_rows + 3) * kSquare}, 255);
  for (int y = kSquare; y < (corner_rows + 2) * kSquare; ++y) {
    for (int x = kSquare; x < (corner_columns + 2) * kSquare; ++x) {
      if ((x / kSquare + y / kSquare) % 2 == 1) continue;
      image.bytes[static_cast<size_t>(y) * image.size.width + x] = 20;
    }
  }
  return image;
}

/// The message of a search for a board of 9x6 corners in these images, which do not show it.
std::string message_of_search(const std::vector<Image>& images) {
  const calib::BoardDetector detector(calib::parse_board("chess:9x6:25mm"));
  return test::message_of<InputError>([&] { find_boards("cam", source_of(images), detector); });
}

TEST(BoardSearch, in_any_number_of_images_without_a_board_is_rejected) {
  for (const size_t count : {12U, 30U}) {
    const std::vector<Image> images(count, grey_image({320, 240}, 120));
    EXPECT_THAT(message_of_search(images),
                testing::HasSubstr("too few boards: no chess:9x6:25mm in any of " +
                                   std::to_string(count) + " images"));
  }
}

TEST(BoardSearch, in_many_images_of_another_board_reports_its_size) {
  const std::vector<Image> images(14, chessboard(8, 5));
  EXPECT_THAT(message_of_search(images),
              testing::HasSubstr("image 0: wrong board size: a chessboard of 8x5 inner corners"));
}

TEST(BoardSearch, in_images_of_another_board_reports_the_size_that_most_of_them_show) {
  // The last columns of squares are not visible.
  Image part = chessboard(8, 5);
  for (int y = 0; y < part.size.height; ++y) {
    const auto row = part.bytes.begin() + static_cast<std::ptrdiff_t>(y) * part.size.width;
    std::fill(row + 240, row + part.size.width, uint8_t{255});
  }
  const Image whole = chessboard(8, 5);
  EXPECT_THAT(message_of_search({part}),
              testing::HasSubstr("image 0: wrong board size: a chessboard of 6x5 inner corners"));
  EXPECT_THAT(message_of_search({part, whole, whole}),
              testing::HasSubstr("image 1: wrong board size: a chessboard of 8x5 inner corners"));
}

TEST(BoardSearch, reports_the_smallest_pattern_only_where_no_image_shows_a_larger_one) {
  Image small = grey_image(chessboard(8, 5).size, 255);
  const Image three = chessboard(3, 3);
  for (int y = 0; y < three.size.height; ++y) {
    std::copy_n(three.bytes.begin() + static_cast<std::ptrdiff_t>(y) * three.size.width,
                three.size.width,
                small.bytes.begin() + static_cast<std::ptrdiff_t>(y) * small.size.width);
  }
  EXPECT_THAT(message_of_search({small, small}),
              testing::HasSubstr("image 0: wrong board size: a chessboard of 3x3 inner corners"));
  EXPECT_THAT(message_of_search({small, small, chessboard(8, 5)}),
              testing::HasSubstr("image 2: wrong board size: a chessboard of 8x5 inner corners"));
}

/// Saves plates of one grey value as the background of the cameras.
void save_plates(const std::filesystem::path& folder, const Rig& rig, ImageSize size) {
  Image plate(size, PixelFormat::kRGB8);
  std::fill(plate.bytes.begin(), plate.bytes.end(), uint8_t{120});
  const auto model = segmentation::learn_background({plate.view(), plate.view()});
  for (const RigCamera& camera : rig) segmentation::save_background(folder, camera.name, model);
}

TEST(FloorPlaces, need_plates_of_the_size_of_the_calibration) {
  const test::TemporaryFolder folder;
  const take::TakePaths take{folder / "take"};
  std::filesystem::create_directory(take.folder);
  // The cameras look down at the floor from 1 m.
  Rig rig = test::small_rig(4);
  for (RigCamera& camera : rig) {
    const RigidTransform up{Eigen::Matrix3d::Identity(), {0, 0, 1}};
    camera.model = calib::with_pose(camera.model, camera.model.cam_from_world() * up.inverse());
  }
  save_plates(take.background(), rig, rig[0].model.size());
  EXPECT_FALSE(floor_places(take.folder, rig, 0).empty());
  save_plates(take.background(), rig, {128, 96});
  EXPECT_THAT(test::message_of<InputError>([&] { floor_places(take.folder, rig, 0); }),
              testing::HasSubstr("a: its plates are 128x96, but it was calibrated at 64x48"));
}

/// The exit status of `v3dctl calibrate WORDS`, which is interrupted before it begins.
int interrupted_run(std::vector<std::string> words) {
  ctl::catch_interrupts();
  std::raise(SIGINT);
  words.insert(words.begin(), {"v3dctl", "calibrate"});
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  return ctl::run_program(static_cast<int>(argv.size()), argv.data(), add_calibrate);
}

class InterruptedCalibration : public testing::Test {
 protected:
  InterruptedCalibration() {
    for (const RigCamera& camera : rig_) {
      const std::string name = camera.name;
      Image grey(camera.model.size(), PixelFormat::kRGB8);
      std::fill(grey.bytes.begin(), grey.bytes.end(), uint8_t{120});
      write_png(folder_ / (name + ".png"), grey.view());
      images_.insert(images_.end(), {"--images", name + "=" + path(name + ".png")});
    }
    save_calib(calib_, rig_);
  }
  std::string path(const std::string& name) const { return (folder_ / name).string(); }
  const test::TemporaryFolder folder_;
  const Rig rig_ = test::small_rig(2);
  const std::string calib_ = path("calib.toml");
  std::vector<std::string> images_;
};

TEST_F(InterruptedCalibration, of_colours_keeps_the_file) {
  const std::string before = read_file(calib_);
  std::vector<std::string> words = {"colour", "--with", "grey", "--calib", calib_, "--out", calib_};
  words.insert(words.end(), images_.begin(), images_.end());
  EXPECT_EXIT(std::exit(interrupted_run(words)), testing::ExitedWithCode(kExitFailed),
              "interrupted");
  EXPECT_EQ(read_file(calib_), before);
}

TEST_F(InterruptedCalibration, keeps_the_file_after_its_last_step) {
  const std::string before = read_file(calib_);
  EXPECT_EXIT(
      {
        ctl::catch_interrupts();
        std::raise(SIGTERM);
        test::message_of<std::runtime_error>([&] { save_result(calib_, test::small_rig(3)); });
        std::exit(read_file(calib_) == before ? 0 : 1);
      },
      testing::ExitedWithCode(0), "");
}

/// Runs `v3dctl calibrate WORDS`.
test::CommandOutcome outcome_of(std::vector<std::string> words) {
  words.insert(words.begin(), "calibrate");
  return test::run_command(add_calibrate, std::move(words));
}

/// What `v3dctl calibrate WORDS` prints on stderr. It must reject its arguments.
std::string error_of_command(std::vector<std::string> words) {
  const test::CommandOutcome outcome = outcome_of(std::move(words));
  EXPECT_EQ(outcome.status, kExitBadInput);
  return outcome.error;
}

class CalibrationOutputs : public testing::Test {
 protected:
  CalibrationOutputs() { save_calib(calib_, test::small_rig(2)); }

  /// The same of a command with images, which do not exist.
  static std::string error_of(std::vector<std::string> words) {
    words.insert(words.end(), {"--images", "a=/not/there/*.png"});
    return error_of_command(words);
  }
  const test::TemporaryFolder folder_;
  const std::string calib_ = (folder_ / "calib.toml").string();
  const std::string absent_ = (folder_ / "absent" / "x").string();
};

TEST_F(CalibrationOutputs, of_which_one_would_replace_another_are_rejected_before_the_work) {
  const std::string before = read_file(calib_);
  EXPECT_THAT(error_of({"rig", "--board", "chess:9x6:25mm", "--out", calib_, "--report", calib_}),
              testing::HasSubstr("is the file of --out; use another"));
  const std::string other = (folder_ / "other.toml").string();
  const std::string again = (folder_ / "." / "calib.toml").string();
  EXPECT_THAT(error_of({"rig", "--board", "chess:9x6:25mm", "--before", calib_, "--out", other,
                        "--report", again}),
              testing::HasSubstr("is the file of --before; use another"));
  EXPECT_THAT(
      error_of({"colour", "--with", "grey", "--calib", calib_, "--out", other, "--report", calib_}),
      testing::HasSubstr("is the file of --calib; use another"));
  EXPECT_EQ(read_file(calib_), before);
}

TEST_F(CalibrationOutputs, stay_where_a_camera_has_a_name_that_they_could_not_hold) {
  const std::string before = read_file(calib_);
  for (const char* option : {"--images", "--video"}) {
    EXPECT_THAT(
        error_of_command({"rig", "--board", "chess:9x6:25mm", option, "front left=x*.png", option,
                          "b=y*.png", "--out", calib_}),
        testing::HasSubstr(std::string(option) + " front left: " + std::string(kCameraNameRule)));
  }
  EXPECT_EQ(read_file(calib_), before);
}

TEST_F(CalibrationOutputs, that_cannot_be_written_are_rejected_before_the_work) {
  for (const std::vector<std::string>& words : std::vector<std::vector<std::string>>{
           {"rig", "--board", "chess:9x6:25mm", "--out", absent_},
           {"rig", "--board", "chess:9x6:25mm", "--out", calib_, "--report", absent_},
           {"floor", "--board", "chess:9x6:25mm", "--calib", calib_, "--out", absent_},
           {"colour", "--calib", calib_, "--out", calib_, "--report", absent_},
           {"intrinsics", "--board", "chess:9x6:25mm", "--out", absent_}}) {
    EXPECT_THAT(error_of(words), testing::HasSubstr("does not exist")) << words.front();
  }
  EXPECT_THAT(error_of_command({"guess", "--size", "64x48", "--out", absent_}),
              testing::HasSubstr("does not exist"));
}

TEST_F(CalibrationOutputs, that_are_files_of_a_take_are_rejected_before_the_work) {
  const std::filesystem::path take = folder_ / "take";
  const std::string recorded = take / "calib.toml";
  std::filesystem::create_directory(take);
  save_calib(recorded, test::small_rig(2));
  replace_file(take / "take.toml", "");
  for (const std::vector<std::string>& words : std::vector<std::vector<std::string>>{
           {"rig", "--board", "chess:9x6:25mm", "--out", recorded},
           {"rig", "--board", "chess:9x6:25mm", "--out", calib_, "--report", recorded},
           {"floor", "--board", "chess:9x6:25mm", "--calib", calib_, "--out", recorded},
           {"colour", "--calib", calib_, "--out", recorded},
           {"intrinsics", "--board", "chess:9x6:25mm", "--out", recorded}}) {
    EXPECT_THAT(error_of(words), testing::HasSubstr("is a recorded file of a take"))
        << words.front();
  }
}

TEST_F(CalibrationOutputs, of_colours_are_rejected_for_an_option_that_the_comparison_does_not_use) {
  const std::string before = read_file(calib_);
  for (const char* with : {"surface,floor", "surface", "floor"}) {
    EXPECT_THAT(error_of_command({"colour", "--calib", calib_, "--out", calib_, "--with", with,
                                  "--take", absent_, "--every", "5"}),
                testing::HasSubstr("--every chooses images of a chart or a grey card"));
  }
  EXPECT_THAT(error_of_command({"colour", "--calib", calib_, "--out", calib_, "--with", "grey",
                                "--take", absent_, "--every", "5"}),
              testing::Not(testing::HasSubstr("--every")));
  EXPECT_EQ(read_file(calib_), before);
}

TEST_F(CalibrationOutputs, of_a_refined_rig_need_two_cameras) {
  const std::string single = (folder_ / "single.toml").string();
  save_calib(single, test::small_rig(1));
  const std::string error =
      error_of_command({"refine", "--take", absent_, "--calib", single, "--out", calib_});
  EXPECT_THAT(error, testing::HasSubstr("single.toml: has one camera"));
  EXPECT_THAT(error, testing::Not(testing::HasSubstr("--bounds")));
}

TEST(ConvertedCalibration, for_colmap_keeps_the_points_of_another_model) {
  const test::TemporaryFolder folder;
  const std::filesystem::path model = folder / "sparse";
  const std::string calib = (folder / "calib.toml").string();
  save_calib(calib, test::small_rig(2));
  const std::vector<std::string> words = {"convert", calib, model.string(), "--to", "colmap"};
  for (int i = 0; i < 2; ++i) {
    EXPECT_EQ(outcome_of(words).status, kExitDone) << "its own output is replaced";
  }
  const std::string points = "# points\n1 0.5 0.5 1 10 20 30 0.1 1 2\n";
  const std::string images = read_file(model / "images.txt") + "# of another program\n";
  replace_file(model / "points3D.txt", points);
  replace_file(model / "images.txt", images);
  EXPECT_THAT(error_of_command(words),
              testing::HasSubstr("points3D.txt: has the points of another model"));
  EXPECT_EQ(read_file(model / "points3D.txt"), points);
  EXPECT_EQ(read_file(model / "images.txt"), images);
}

TEST(ConvertedCalibration, that_no_command_could_read_is_rejected_and_keeps_the_file) {
  const test::TemporaryFolder folder;
  const std::filesystem::path model = folder / "sparse";
  const std::string calib = (folder / "calib.toml").string();
  std::filesystem::create_directory(model);
  save_calib(calib, test::small_rig(2));
  const std::string before = read_file(calib);
  const std::string far_away = "1 1 0 0 0 4075539.9 931735.3 4801629.6 1 a.png\n\n";
  replace_file(model / "cameras.txt", "1 PINHOLE 640 480 500 501 320.5 240.5\n");
  replace_file(model / "images.txt", far_away);
  EXPECT_THAT(
      error_of_command({"convert", model.string(), calib}),
      testing::HasSubstr("from the origin of the world; move the origin to the space first"));
  replace_file(model / "cameras.txt", "1 PINHOLE 640 480 5000000 501 320.5 240.5\n");
  replace_file(model / "images.txt", "1 1 0 0 0 0 0 0 1 a.png\n\n");
  EXPECT_THAT(error_of_command({"convert", model.string(), calib}),
              testing::HasSubstr("calib.toml cannot hold this rig"));
  EXPECT_EQ(read_file(calib), before);
}

}  // namespace
}  // namespace v3d::calibrate
