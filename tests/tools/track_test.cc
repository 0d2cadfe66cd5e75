#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "base/config/calib_file.h"
#include "base/core/error.h"
#include "base/image/image_files.h"
#include "base/io/file.h"
#include "codec/motion_codec.h"
#include "common/mesh_formats.h"
#include "daemon/recorded/mesh_frames.h"
#include "recon/render/renderer.h"
#include "recon/shapes.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"
#include "support/unreadable_byte.h"
#include "take/take_lock.h"
#include "tools/command_outcome.h"
#include "tools/gliding_take.h"
#include "tools/test_images.h"
#include "v3dctl/evaluate/evaluate.h"
#include "v3dctl/import/import.h"
#include "v3dctl/motion/pulse_source.h"
#include "v3dctl/motion/take_motion.h"
#include "v3dctl/reconstruct/take_reconstruction.h"

namespace v3d::ctl {
namespace {

using testing::AllOf;
using testing::HasSubstr;
namespace fs = std::filesystem;

/// A flattened body of 2 units along y, which bends sideways with the number of the pulse.
Mesh body_at(int pulse) {
  Mesh mesh = recon::shapes::sphere({0, 0, 0}, 0.3F, 30);
  for (Eigen::Vector3f& p : mesh.vertices) {
    p = {0.6F * p.x(), 3.3F * p.z(), -p.y()};
    p.z() += 0.04F * static_cast<float>(pulse) * p.y() * p.y();
  }
  return mesh;
}

void write_obj(const fs::path& file, const Mesh& mesh) {
  std::string text = "# a body\n";
  for (const Eigen::Vector3f& v : mesh.vertices) {
    text += "v " + std::to_string(v.x()) + " " + std::to_string(v.y()) + " " +
            std::to_string(v.z()) + "\n";
  }
  for (const auto& [a, b, c] : mesh.triangles) {
    text += "f " + std::to_string(a + 1) + " " + std::to_string(b + 1) + " " +
            std::to_string(c + 1) + "\n";
  }
  test::write_text(file, text);
}

class Track : public testing::Test {
 protected:
  TrackReport track(const TrackRequest& request) {
    return track_take(
        request, [](int64_t) {}, [this] { ++turns_; });
  }
  TrackRequest of_meshes(const std::string& name) {
    TrackRequest request;
    request.input = folder_ / name;
    request.out = folder_ / (name + ".v3d");
    request.meshes_only = true;
    request.tracking.triangles = 2000;
    request.threads = 2;
    return request;
  }
  std::string rejection(const TrackRequest& request) {
    return test::message_of<InputError>([&] { track(request); });
  }

  test::TemporaryFolder folder_;
  int turns_ = 0;
};

TEST_F(Track, follows_the_meshes_of_a_folder_scaled_and_turned_upright) {
  fs::create_directory(folder_ / "body");
  for (int pulse = 0; pulse < 4; ++pulse) {
    write_obj(folder_ / "body" / ("f" + std::to_string(pulse) + ".obj"), body_at(pulse));
  }
  test::write_text(folder_ / "body" / "notes.txt", "no mesh");
  TrackRequest request = of_meshes("body");
  request.height_m = 1.8;
  const TrackReport report = track(request);
  EXPECT_EQ(report.pulses, 4);
  ASSERT_EQ(report.segments.size(), 1U);
  EXPECT_EQ(report.segments[0].pulses, 4);
  EXPECT_LT(report.segments[0].residual_p50_mm, 2);
  EXPECT_TRUE(report.untracked.empty());
  EXPECT_GE(turns_, 3 * 4 - 2);

  const std::string bytes = read_file(request.out);
  EXPECT_EQ(report.bytes, std::ssize(bytes));
  auto motion =
      codec::MotionReader::open({reinterpret_cast<const uint8_t*>(bytes.data()), bytes.size()});
  ASSERT_TRUE(motion);
  Mesh last;
  for (const auto& [x, y, z] : motion->decode(0, 3)->positions) last.vertices.emplace_back(x, y, z);
  const Box box = recon::bounds_of(last);
  EXPECT_NEAR(box.size().z(), 1.8, 0.02) << "y was up";
}

Mesh scaled(Mesh mesh, float scale) {
  for (Eigen::Vector3f& vertex : mesh.vertices) vertex *= scale;
  return mesh;
}

TEST_F(Track, has_the_scale_of_the_first_mesh_by_number_also_for_later_frames) {
  fs::create_directory(folder_ / "body");
  write_obj(folder_ / "body" / "scan_2.obj", body_at(0));
  write_obj(folder_ / "body" / "scan_10.obj", scaled(body_at(0), 0.5F));
  const auto height = [&](take::FrameRange frames) {
    return recon::bounds_of(open_mesh_folder(folder_ / "body", 1.8, frames)->read(0)->surface)
        .size()
        .z();
  };
  EXPECT_NEAR(height({}), 1.8, 1e-3);
  EXPECT_NEAR(height({1, 2}), 0.9, 1e-3);
}

TEST_F(Track, has_the_scale_and_the_steps_of_the_first_mesh_that_is_not_empty) {
  fs::create_directory(folder_ / "body");
  write_ply(folder_ / "body" / "0.ply", {});
  write_obj(folder_ / "body" / "1.obj", body_at(0));
  const auto input = open_mesh_folder(folder_ / "body", 1.8, {});
  EXPECT_TRUE(input->read(0)->surface.vertices.empty());
  EXPECT_NEAR(recon::bounds_of(input->read(1)->surface).size().z(), 1.8, 1e-3);
  write_obj(folder_ / "body" / "1.obj", scaled(body_at(0), 900));  // millimetres
  EXPECT_THAT(rejection(of_meshes("body")), AllOf(HasSubstr("--step"), HasSubstr("--height")));
  EXPECT_EQ(turns_, 0);
}

TEST_F(Track, rejects_meshes_that_are_too_large_for_the_steps_before_it_tracks) {
  fs::create_directory(folder_ / "body");
  write_obj(folder_ / "body" / "0.obj", scaled(body_at(0), 900));  // millimetres
  EXPECT_THAT(rejection(of_meshes("body")), AllOf(HasSubstr("--step"), HasSubstr("--height")));
  EXPECT_EQ(turns_, 0);
}

TEST_F(Track, rejects_a_folder_without_meshes_and_a_face_without_its_vertex) {
  fs::create_directory(folder_ / "empty");
  EXPECT_THAT(rejection(of_meshes("empty")), HasSubstr("has no mesh to track"));
  EXPECT_THAT(rejection(of_meshes("absent")), HasSubstr("is not a folder"));
  fs::create_directory(folder_ / "bad");
  test::write_text(folder_ / "bad" / "0.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 7\n");
  EXPECT_THAT(rejection(of_meshes("bad")), HasSubstr("0.obj"));
  test::write_text(folder_ / "bad" / "0.obj", "v 0 0 0\nv 1e39 0 0\nv 0 1 0\nf 1 2 3\n");
  EXPECT_THAT(rejection(of_meshes("bad")), HasSubstr("vertex 2 is not finite"));
  test::write_text(folder_ / "bad" / "0.obj", "v 0 0 0\n");
  EXPECT_THAT(rejection(of_meshes("bad")), HasSubstr("has no face"));
  EXPECT_FALSE(fs::exists(folder_ / "bad.v3d"));
}

/// Copies DIR/a.png to DIR/a/0.png, DIR/a/1.png, ...
void repeat_pictures(const fs::path& folder, const Rig& rig, int pulses) {
  for (const RigCamera& camera : rig) {
    const fs::path picture = folder / (camera.name + ".png");
    fs::create_directory(folder / camera.name);
    for (int pulse = 0; pulse < pulses; ++pulse) {
      fs::copy_file(picture, folder / camera.name / (std::to_string(pulse) + ".png"));
    }
    fs::remove(picture);
  }
}

/// Makes the ball in the second picture of each camera, DIR/a/1.png, ..., brighter.
void brighten_second(const fs::path& folder, const Rig& rig, int by_grey_values) {
  for (const RigCamera& camera : rig) {
    Image image = test::ball_image(camera);
    for (uint8_t& byte : image.bytes) {
      if (byte > 0) byte = static_cast<uint8_t>(std::min(byte + by_grey_values, 255));
    }
    write_png(folder / camera.name / "1.png", image.view());
  }
}

/// Around the ball of the take.
const Box kSpace{{-0.5, -0.5, -0.5}, {0.5, 0.5, 0.5}};

/// A take of a ball, reconstructed.
class TrackTake : public Track {
 protected:
  /// The ball is brighter at the second pulse, by so many grey values.
  explicit TrackTake(int pulses = 1, int brighter_by = 0) {
    const Rig rig = test::small_rig(8);
    save_calib(folder_ / "calib.toml", rig);
    test::write_pictures(folder_ / "images", rig, test::ball_image);
    test::write_pictures(folder_ / "masks", rig, test::ball_mask);
    repeat_pictures(folder_ / "images", rig, pulses);
    repeat_pictures(folder_ / "masks", rig, pulses);
    if (brighter_by > 0) brighten_second(folder_ / "images", rig, brighter_by);
    ImportOptions import;
    import.take = take_;
    import.calib = folder_ / "calib.toml";
    import.images = folder_ / "images";
    import.masks = folder_ / "masks";
    import_take(import);
    request_.input = take_;
    request_.threads = 2;
  }
  void reconstruct(const Box& bounds = kSpace, const std::vector<std::string>& leave_out = {}) {
    ReconstructRequest request;
    request.take = take_;
    request.leave_out = leave_out;
    request.bounds = bounds;
    request.voxel_m = 0.02;
    request.threads = 2;
    reconstruct_take(request);
  }

  const fs::path take_ = folder_ / "take";
  TrackRequest request_;
};

TEST_F(TrackTake, writes_a_coloured_surface_beside_the_meshes_that_commands_can_read) {
  EXPECT_THAT(rejection(request_), HasSubstr("run v3dctl reconstruct"));
  reconstruct();
  const TrackReport report = track(request_);
  ASSERT_EQ(report.segments.size(), 1U);
  const fs::path file = take::TakePaths{take_}.motion();
  EXPECT_TRUE(recorded::is_motion_file(file));
  EXPECT_FALSE(recorded::is_motion_file(take::TakePaths{take_}.mesh()));
  recorded::MeshFrames frames(take_, file);
  EXPECT_EQ(frames.frames({}), (std::vector<int64_t>{0}));
  const recon::CompactFrame frame = frames.read(0);
  EXPECT_EQ(frame.cameras.size(), 8U);
  EXPECT_EQ(frame.mesh.colours.size(), frame.mesh.vertices.size());
  EXPECT_TRUE(is_watertight(frame.mesh));
  for (const Eigen::Vector3f& vertex : frame.mesh.vertices) {
    EXPECT_NEAR(vertex.norm(), 0.3F, 0.05F);
  }
}

TEST_F(TrackTake, is_rejected_without_a_surface_and_keeps_the_old_motion) {
  reconstruct();
  track(request_);
  const fs::path file = take::TakePaths{take_}.motion();
  const std::string before = read_file(file);
  reconstruct({{-0.2, -0.2, 0.4}, {0.2, 0.2, 0.5}});  // above the ball
  fs::rename(take::TakePaths{take_}.earlier_motion(1), file);
  EXPECT_THAT(rejection(request_), HasSubstr("no pulse has a surface to track"));
  EXPECT_EQ(read_file(file), before);
}

TEST_F(TrackTake, has_no_surface_of_earlier_meshes_and_keeps_each_under_another_name) {
  const take::TakePaths paths{take_};
  reconstruct();
  for (const int number : {1, 2}) {
    const std::string surface = "surface " + std::to_string(number);
    test::write_text(paths.motion(), surface);
    const std::vector<std::string> left_out{number == 1 ? "c" : "d"};
    testing::internal::CaptureStderr();
    reconstruct(kSpace, left_out);
    EXPECT_THAT(
        testing::internal::GetCapturedStderr(),
        HasSubstr("motion.v3d to " + paths.earlier_motion(number).filename().string() +
                  ": it was tracked on the earlier meshes; v3dctl track " + take_.string()));
    EXPECT_FALSE(fs::exists(paths.motion()));
    EXPECT_EQ(read_file(paths.earlier_motion(number)), surface);
  }
  EXPECT_EQ(read_file(paths.earlier_motion(1)), "surface 1");
}

TEST_F(TrackTake, keeps_the_surface_where_another_reconstruction_makes_the_same_meshes) {
  const take::TakePaths paths{take_};
  reconstruct();
  test::write_text(paths.motion(), "surface");
  reconstruct();
  EXPECT_EQ(read_file(paths.motion()), "surface");
  EXPECT_FALSE(fs::exists(paths.earlier_motion(1)));
}

TEST_F(TrackTake, uses_no_images_of_a_camera_that_the_reconstruction_left_out) {
  reconstruct(kSpace, {"c"});
  const auto pulse = open_take_pulses(take_, {})->read(0);
  const std::vector<Frame>& frames = pulse->frames.frames;
  EXPECT_EQ(frames.size(), 7U);
  EXPECT_EQ(std::ranges::count(frames, std::string("c"), &Frame::camera), 0);
  EXPECT_EQ(pulse->cameras.cameras.size(), 7U);
}

TEST_F(TrackTake, reports_a_damaged_motion_file) {
  reconstruct();
  track(request_);
  const fs::path file = take::TakePaths{take_}.motion();
  std::string bytes = read_file(file);
  bytes.resize(bytes.size() / 2);
  test::write_text(file, bytes);
  EXPECT_THAT(test::message_of<InputError>([&] { recorded::MeshFrames(take_, file); }),
              HasSubstr("motion.v3d: is damaged: run v3dctl track again"));
}

TEST_F(TrackTake, reports_meshes_without_the_end_of_their_file) {
  reconstruct();
  EXPECT_FALSE(track(request_).is_unfinished);
  const fs::path mesh = take::TakePaths{take_}.mesh();
  fs::resize_file(mesh, fs::file_size(mesh) - 1);
  EXPECT_TRUE(track(request_).is_unfinished);
}

TEST_F(TrackTake, is_rejected_while_it_is_recorded) {
  reconstruct();
  const auto lock = take::TakeLock::acquire({take_}, "cap01");
  ASSERT_TRUE(lock);
  EXPECT_THAT(rejection(request_), AllOf(HasSubstr("is being recorded"), HasSubstr("by process ")));
}

class TrackTwoPulses : public TrackTake {
 protected:
  TrackTwoPulses() : TrackTake(2) { reconstruct(); }
};

TEST_F(TrackTwoPulses, are_not_measured_without_true_points_or_without_a_tracked_surface) {
  track(request_);
  const EvaluatedMeshes motion{take_, take::TakePaths{take_}.motion()};
  EXPECT_FALSE(evaluate_motion(motion, folder_ / "truth")) << "no points";
  EXPECT_FALSE(evaluate_motion({take_}, folder_ / "truth")) << "no motion file";
}

TEST_F(TrackTwoPulses, are_compared_incompletely_where_one_has_no_true_surface) {
  const fs::path truth = folder_ / "truth", last = truth / "000001.ply";
  fs::create_directory(truth);
  write_ply(truth / "000000.ply", recon::shapes::sphere({0, 0, 0}, 0.3F, 30));
  fs::copy_file(truth / "000000.ply", last);
  const std::vector<std::string> words{"track",       take_,  "--truth",   truth, "--json",
                                       "--triangles", "1000", "--threads", "2"};
  testing::internal::CaptureStdout();
  EXPECT_EQ(test::run_command(add_track, words).status, kExitDone);
  fs::remove(last);
  const test::CommandOutcome outcome = test::run_command(add_track, words);
  testing::internal::GetCapturedStdout();
  EXPECT_EQ(outcome.status, kExitIncomplete);
  EXPECT_THAT(outcome.error, HasSubstr("v3dctl: no truth in " + truth.string() +
                                       " for 1 frame of the tracked surface"));
}

TEST_F(TrackTwoPulses, have_surfaces_for_the_choice_of_key_pulses_without_their_images) {
  const auto log_bytes = static_cast<off_t>(fs::file_size(take::TakePaths{take_}.frames("a")));
  ASSERT_GT(log_bytes, static_cast<off_t>(fs::file_size(take::TakePaths{take_}.mesh())) + 2000);
  const auto input = open_take_pulses(take_, {});
  const auto first = input->read_surface(0);
  EXPECT_EQ(first->surface.triangles, input->read(0)->surface.triangles);
  EXPECT_GE(recon::key_quality(*first).score(1), recon::key_quality(*input->read(0)).score(1));
  const test::UnreadableByte bad(log_bytes - 1000, take_);  // in the frame of pulse 1
  EXPECT_EQ(input->read_surface(1)->cameras.cameras.size(), 8U);
  EXPECT_TRUE(input->read_errors().empty());
  EXPECT_TRUE(input->read(1)->cameras.cameras.empty());
}

TEST_F(TrackTwoPulses, have_colours_of_the_nearest_pulse_where_images_cannot_be_read) {
  const auto log_bytes = static_cast<off_t>(fs::file_size(take::TakePaths{take_}.frames("a")));
  ASSERT_GT(log_bytes, static_cast<off_t>(fs::file_size(take::TakePaths{take_}.mesh())) + 2000);
  TrackReport report;
  {
    const test::UnreadableByte bad(log_bytes - 1000, take_);  // in the frame of pulse 1
    report = track(request_);
  }
  EXPECT_EQ(report.without_images, (std::vector<int64_t>{1}));
  ASSERT_GE(report.read_errors.size(), 8U);
  EXPECT_THAT(report.read_errors[0], HasSubstr("a.lcmlog"));
  ASSERT_EQ(report.segments.size(), 1U);
  recorded::MeshFrames frames(take_, take::TakePaths{take_}.motion());
  const std::vector<Rgb8> seen = frames.read(0).mesh.colours;
  EXPECT_GT(seen.at(0).r, 150);
  EXPECT_EQ(frames.read(1).mesh.colours, seen);
}

TEST_F(TrackTwoPulses, are_kept_as_far_as_the_file_has_room_for_them) {
  const TrackReport whole = track(request_);
  ASSERT_EQ(whole.segments.size(), 1U);
  EXPECT_FALSE(whole.full_from);
  request_.max_bytes = static_cast<uint64_t>(whole.bytes - 1);
  const TrackReport part = track(request_);
  EXPECT_EQ(part.full_from, 1);
  ASSERT_EQ(part.segments.size(), 1U);
  EXPECT_EQ(part.segments[0].last, 0);
  ASSERT_EQ(part.untracked.size(), 1U);
  EXPECT_EQ(part.untracked[0].first, 1);
  EXPECT_EQ(part.untracked[0].last, 1);
  EXPECT_EQ(part.untracked[0].reason, "the file is full");
  EXPECT_LT(part.bytes, whole.bytes);
  const fs::path file = take::TakePaths{take_}.motion();
  EXPECT_EQ(recorded::MeshFrames(take_, file).frames({}), (std::vector<int64_t>{0}));
  request_.max_bytes = 200;
  EXPECT_THAT(rejection(request_), HasSubstr("from pulse 0 exceeds the limits of motion.v3d"));
  EXPECT_EQ(static_cast<int64_t>(fs::file_size(file)), part.bytes) << "the older file stays";
}

class TrackNoisyPulses : public TrackTake {
 protected:
  TrackNoisyPulses() : TrackTake(2, 14) { reconstruct(); }
};

/// The vertices that are brighter at the second pulse than at the first, as a share of all.
double brighter_share(const fs::path& take, int by_grey_values) {
  recorded::MeshFrames frames(take, take::TakePaths{take}.motion());
  const std::vector<Rgb8> first = frames.read(0).mesh.colours, second = frames.read(1).mesh.colours;
  EXPECT_EQ(first.size(), second.size());
  int brighter = 0;
  for (size_t v = 0; v < first.size(); ++v) {
    brighter += second.at(v).g >= first[v].g + by_grey_values ? 1 : 0;
  }
  return static_cast<double>(brighter) / static_cast<double>(first.size());
}

TEST_F(TrackNoisyPulses, have_steady_colours) {
  track(request_);
  EXPECT_LT(brighter_share(take_, 3), 0.05);
}

class TrackBrighterPulse : public TrackTake {
 protected:
  TrackBrighterPulse() : TrackTake(2, 60) { reconstruct(); }
};

TEST_F(TrackBrighterPulse, has_its_own_colours_because_the_change_is_large) {
  track(request_);
  EXPECT_GT(brighter_share(take_, 25), 0.75);
}

/// Writes the true points of a gliding take; every second one is on a sleeve. At the last pulse
/// they are higher by so much. Returns their number.
int64_t write_gliding_points(const fs::path& take, const fs::path& truth, float raised_m) {
  fs::create_directories(truth / "points");
  const Mesh surface = recorded::MeshFrames(take).read(0).mesh;
  Mesh points;
  for (size_t v = 0; v < surface.vertices.size(); v += 50) {
    points.vertices.push_back(surface.vertices[v]);
    points.colours.push_back({255, static_cast<uint8_t>(points.colours.size() % 2), 0});
  }
  for (int pulse = 0; pulse < test::kGlidingPulses; ++pulse) {
    Mesh moved = points;
    for (Eigen::Vector3f& point : moved.vertices) {
      point.x() += 0.01F * static_cast<float>(pulse);
      if (pulse + 1 == test::kGlidingPulses) point.z() += raised_m;
    }
    write_ply(truth / "points" / ("00000" + std::to_string(pulse) + ".ply"), moved);
  }
  return std::ssize(points.vertices);
}

TEST_F(Track, is_measured_with_points_of_the_true_surface) {
  const fs::path take = folder_ / "take", truth = folder_ / "truth";
  test::write_gliding_take(take);
  const EvaluatedMeshes evaluated{take, take::TakePaths{take}.motion()};
  for (const float raised_m : {0.0F, 0.02F}) {
    const int64_t points = write_gliding_points(take, truth, raised_m);
    const auto motion = evaluate_motion(evaluated, truth);
    ASSERT_TRUE(motion);
    EXPECT_EQ(motion->segments, 1);
    EXPECT_EQ(motion->bound, 1);
    ASSERT_EQ(motion->carried.size(), 1U);
    const CarriedReport& last = motion->carried[0];
    EXPECT_EQ(last.pulses, test::kGlidingPulses - 1);
    EXPECT_EQ(last.all.points, points);
    EXPECT_EQ(last.sleeves.points, points / 2);
    EXPECT_EQ(last.sword.points, 0);
    EXPECT_NEAR(last.all.p50_mm, 1000 * raised_m, 1);
    EXPECT_NEAR(last.sleeves.p90_mm, 1000 * raised_m, 1);
  }
}

TEST_F(Track, is_measured_only_with_points_that_have_the_colours_of_cameras_and_parts) {
  const fs::path take = folder_ / "take", truth = folder_ / "truth";
  test::write_gliding_take(take);
  fs::create_directories(truth / "points");
  const Mesh points{.vertices = {{0, 0, 1}, {0, 0, 1.1F}}, .triangles = {}, .colours = {}};
  write_ply(truth / "points" / "000000.ply", points);
  write_ply(truth / "points" / "000001.ply", points);
  const EvaluatedMeshes motion{take, take::TakePaths{take}.motion()};
  EXPECT_EQ(test::message_of<InputError>([&] { evaluate_motion(motion, truth); }),
            (truth / "points" / "000000.ply").string() +
                ": has no colours; expected red, green and blue, as v3d-sim take --truth writes");
}

}  // namespace
}  // namespace v3d::ctl
