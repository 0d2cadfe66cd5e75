// Tests the library of v3d-sim.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <nlohmann/json.hpp>

#include "base/config/calib_file.h"
#include "base/config/studio_file.h"
#include "base/core/error.h"
#include "base/image/mask_operations.h"
#include "base/io/file.h"
#include "capture/segmentation/segmenter.h"
#include "common/mesh_formats.h"
#include "sim/performer/motion.h"
#include "sim/rendering/scene.h"
#include "sim/small_take.h"
#include "sim/tiny_body.h"
#include "support/temporary_folder.h"
#include "take/ledger/ledger.h"
#include "take/logs/frame_log.h"
#include "take/take.h"
#include "v3d-sim/performer_file.h"
#include "v3d-sim/sim_commands.h"
#include "v3d-sim/simulated_take.h"

namespace v3d::sim {
namespace {

using test::TemporaryFolder;
using testing::HasSubstr;

TEST(StudioOptions, require_an_even_image_size) {
  StudioOptions options{.cameras = 3, .size = "96x64"};
  const Rig rig = rig_of(options);
  ASSERT_EQ(rig.size(), 3U);
  EXPECT_EQ(rig[0].model.size(), (ImageSize{96, 64}));
  options.size = "96x63";
  EXPECT_THAT(refusal([&] { rig_of(options); }), HasSubstr("expected WIDTHxHEIGHT, even"));
}

TEST(StudioOptions, take_the_cameras_of_a_calibration_file) {
  const test::TemporaryFolder folder;
  StudioOptions options{.cameras = 3, .size = "96x64"};
  options.rig = (folder.path() / "rig.toml").string();
  save_calib(options.rig, make_rig(2, {64, 48}, 5));
  const Rig rig = rig_of(options);
  ASSERT_EQ(rig.size(), 2U);
  EXPECT_EQ(rig[1].model.size(), (ImageSize{64, 48}));
  save_calib(options.rig, make_rig(2, {63, 48}, 5));
  EXPECT_THAT(refusal([&] { rig_of(options); }), HasSubstr("images of 63x48, expected even"));
  save_calib(options.rig, make_rig(201, {64, 48}, 5));
  EXPECT_THAT(refusal([&] { rig_of(options); }), HasSubstr("has 201 cameras, expected 1 to 200"));
  options.rig = "/not/there.toml";
  EXPECT_THAT(refusal([&] { rig_of(options); }), HasSubstr("/not/there.toml"));
}

TEST(Faults, are_read_from_toml) {
  const Rig rig = make_rig(3, {64, 48}, 1);
  const auto faults = parse_faults(
      "[[fault]]\ncamera = \"cam02\"\npulse = 3\nkind = \"drop\"\n"
      "[[fault]]\ncamera = \"cam01\"\npulse = 0\nkind = \"suspect\"\n",
      "f.toml", rig, 5);
  ASSERT_EQ(faults.size(), 2U);
  EXPECT_TRUE(has_fault(faults, "cam02", 3, FaultKind::kDrop));
  EXPECT_TRUE(has_fault(faults, "cam01", 0, FaultKind::kSuspect));
  EXPECT_FALSE(has_fault(faults, "cam01", 3, FaultKind::kDrop));
}

TEST(Faults, report_file_line_and_field_of_an_error) {
  const Rig rig = make_rig(3, {64, 48}, 1);
  const auto error = [&](const std::string& text) {
    return refusal([&] { parse_faults(text, "f.toml", rig, 5); });
  };
  const std::string camera = "[[fault]]\ncamera = \"cam02\"\n";
  EXPECT_THAT(error("[[fault]]\npulse = 1\nkind = \"drop\"\n"), HasSubstr("camera"));
  EXPECT_THAT(error("[[fault]]\ncamera = \"cam09\"\npulse = 1\nkind = \"drop\"\n"),
              HasSubstr("f.toml:2: fault.camera: there is no camera 'cam09'"));
  EXPECT_THAT(error(camera + "pulse = 5\nkind = \"drop\"\n"),
              HasSubstr("f.toml:3: fault.pulse: expected 0 to 4"));
  EXPECT_THAT(error(camera + "pulse = -1\nkind = \"drop\"\n"), HasSubstr("fault.pulse"));
  EXPECT_THAT(error(camera + "pulse = \"1\"\nkind = \"drop\"\n"), HasSubstr("fault.pulse"));
  EXPECT_THAT(error(camera + "pulse = 1\nkind = \"tardy\"\n"),
              HasSubstr("f.toml:4: fault.kind: 'tardy' is unknown"));
  EXPECT_THAT(error(camera + "pulse = 1\nkind = \"drop\"\nwhy = 1\n"), HasSubstr("why"));
  const std::string one = camera + "pulse = 1\nkind = \"drop\"\n";
  EXPECT_THAT(error(one + one), HasSubstr("two faults of cam02 at pulse 1"));
  EXPECT_THAT(error("not toml"), HasSubstr("f.toml:1"));
  EXPECT_THAT(refusal([&] { load_faults("/absent.toml", rig, 5); }), HasSubstr("/absent.toml"));
}

TEST(Faults, of_a_studio_require_exactly_the_fields_of_their_kind) {
  const Rig rig = make_rig(3, {64, 48}, 1);
  const auto read = [&](const std::string& text) {
    return parse_faults("[[fault]]\ncamera = \"cam02\"\npulse = 70\n" + text, "f.toml", rig, {});
  };
  const auto error = [&](const std::string& text) { return refusal([&] { read(text); }); };
  EXPECT_EQ(read("kind = \"delay\"\nms = 120\n")[0].time, std::chrono::milliseconds(120));
  EXPECT_EQ(read("kind = \"freeze\"\npulses = 9\n")[0].pulses, 9);
  EXPECT_TRUE(read("kind = \"unplug\"\nms = 5\nnew_clock = true\n")[0].new_clock);
  EXPECT_EQ(read("kind = \"clock\"\njump_ms = -2\n")[0].time, std::chrono::milliseconds(-2));
  EXPECT_EQ(read("kind = \"clock\"\ndrift_ppm = 300\n")[0].drift_ppm, 300);
  EXPECT_EQ(read("kind = \"missed\"\n")[0].kind, FaultKind::kMissed);

  EXPECT_THAT(error("kind = \"delay\"\n"), HasSubstr("f.toml:1: fault.ms"));
  EXPECT_THAT(error("kind = \"delay\"\nms = 0\n"), HasSubstr("f.toml:5: fault.ms: expected 1"));
  EXPECT_THAT(error("kind = \"freeze\"\npulses = 0\n"), HasSubstr("f.toml:5: fault.pulses"));
  EXPECT_THAT(error("kind = \"clock\"\n"), HasSubstr("needs jump_ms, drift_ppm or both"));
  EXPECT_THAT(error("kind = \"drop\"\nms = 3\n"), HasSubstr("f.toml:5: fault.ms"));
  EXPECT_THAT(error("kind = \"suspect\"\n"),
              HasSubstr("f.toml:4: fault.kind: 'suspect' is supported for takes only"));
  EXPECT_THAT(refusal([&] {
                parse_faults("[[fault]]\ncamera = \"cam02\"\npulse = 1\nkind = \"unplug\"\n",
                             "f.toml", rig, 5);
              }),
              HasSubstr("f.toml:4: fault.kind: 'unplug' is supported for studios only"));
}

TEST(Faults, of_a_studio_count_pulses_after_the_empty_pulses) {
  const std::vector<Fault> script = {fault("cam01", 3, FaultKind::kDrop),
                                     fault("cam02", 0, FaultKind::kBlack)};
  const std::vector<Fault> own = faults_at_edges(script, "cam02", 12);
  ASSERT_EQ(own.size(), 1U);
  EXPECT_EQ(own[0].pulse, 12);
  EXPECT_EQ(own[0].kind, FaultKind::kBlack);
}

TEST(Ply, contains_every_vertex_and_face) {
  const TemporaryFolder folder;
  Mesh mesh;
  mesh.vertices = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  mesh.triangles = {{0, 2, 1}, {0, 1, 3}};
  mesh.colours.resize(4);
  write_ply(folder / "m.ply", mesh);
  const std::string bytes = read_file(folder / "m.ply");
  const size_t body = bytes.find("end_header\n") + 11;
  EXPECT_EQ(bytes.size() - body, 4U * 15 + 2U * 13);
  EXPECT_THAT(bytes, HasSubstr("element vertex 4\n"));
  EXPECT_THAT(bytes, HasSubstr("property uchar red\n"));
  EXPECT_THAT(bytes, HasSubstr("element face 2\n"));
}

TEST(StudioText, is_a_valid_studio_file) {
  const TemporaryFolder folder;
  for (const int cameras : {1, 15}) {
    const Rig rig = make_rig(cameras, {1024, 768}, 1);
    const Studio studio = parse_studio(studio_text(rig, {900, 0.008}), folder / "studio.toml");
    ASSERT_EQ(studio.cameras.size(), rig.size());
    EXPECT_EQ(studio.cameras.back().name, rig.back().name);
    EXPECT_EQ(studio.cameras.front().address, "127.0.0.11");
    EXPECT_EQ(studio.cameras.front().node, "cap01");
    EXPECT_EQ(studio.trigger.rate_hz, 900);
    EXPECT_EQ(studio.trigger.wire, folder / "trigger.sock");
    EXPECT_EQ(studio.reconstruction.voxel_m, 0.008);
    EXPECT_LE(studio.reconstruction.min_views, cameras);
    EXPECT_EQ(studio.storage.calib, folder / "calib.toml");
  }
}

TEST(StudioFolder, of_another_studio_is_refused_and_one_of_the_simulator_is_not) {
  const TemporaryFolder folder;
  EXPECT_NO_THROW(require_own_studio(folder.path())) << "empty";
  EXPECT_NO_THROW(require_own_studio(folder / "absent"));
  replace_file(folder / "calib.toml", "# measured with a wand\n");
  EXPECT_THAT(refusal([&] { require_own_studio(folder.path()); }),
              HasSubstr("has a calib.toml that v3d-sim did not write"));
  replace_file(folder / "studio.toml", "name = \"kyoto\"\n");
  EXPECT_THAT(refusal([&] { require_own_studio(folder.path()); }),
              HasSubstr("has a studio.toml that v3d-sim did not write"));
  replace_file(folder / "studio.toml", studio_text(make_rig(1, {64, 48}, 1), {25, 0.01}));
  EXPECT_NO_THROW(require_own_studio(folder.path()));
}

TEST(StudioMemory, is_that_of_the_images_of_all_cameras) {
  Rig rig = make_rig(1, {16, 16}, 1);
  EXPECT_NO_THROW(require_memory(rig, 100, 1'000'000, ""));
  EXPECT_THAT(refusal([&] { require_memory(rig, 10'000, 1'000'000, ""); }),
              HasSubstr("reduce --loop-frames, --cameras or --size"));
  rig.push_back(make_rig(1, {4096, 3072}, 1).front());
  EXPECT_THAT(refusal([&] { require_memory(rig, 100, 1'000'000'000, "rig.toml"); }),
              HasSubstr("the cameras of --rig rig.toml"));
  std::swap(rig[0], rig[1]);
  EXPECT_NO_THROW(require_memory(rig, 100, 2'000'000'000, "rig.toml"));
}

TEST(SimulatedTake, is_complete_and_readable) {
  const TemporaryFolder folder;
  const SimulatedTake take = small_take(folder / "cut");
  write(take);
  const take::TakePaths paths{take.folder};
  const take::TakeInfo info = load_take_info(paths);
  EXPECT_EQ(info.name, "cut");
  EXPECT_EQ(info.state, take::TakeState::kComplete);
  EXPECT_EQ(info.pulses, 5);
  EXPECT_TRUE(take::load_ledger(paths.ledger()).complete());
  EXPECT_EQ(load_calib(paths.calib()).size(), 3U);
  EXPECT_EQ(take::read_pulses(paths.pulses()).size(), 5U);
  for (const RigCamera& camera : take.rig) {
    EXPECT_TRUE(segmentation::has_background(paths.background(), camera.name));
    take::FrameLogReader log(paths.frames(camera.name));
    for (int64_t pulse = 0; pulse < 5; ++pulse) {
      const auto frame = log.read(pulse);
      ASSERT_TRUE(frame);
      EXPECT_EQ(frame->image.size, camera.model.size());
      EXPECT_EQ(frame->image.format, PixelFormat::kBayerRG8);
    }
  }
}

TEST(SimulatedTake, gives_the_same_bytes_twice) {
  const TemporaryFolder folder;
  std::filesystem::create_directories(folder / "a");
  std::filesystem::create_directories(folder / "b");
  write(small_take(folder / "a/cut"));
  write(small_take(folder / "b/cut"));
  int files = 0;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder / "a")) {
    if (!entry.is_regular_file()) continue;
    const auto twin = folder / "b" / std::filesystem::relative(entry.path(), folder / "a");
    EXPECT_EQ(read_file(entry.path()), read_file(twin)) << entry.path();
    ++files;
  }
  EXPECT_GE(files, 7);
}

TEST(SimulatedTake, has_the_given_faults_in_logs_and_ledger) {
  const TemporaryFolder folder;
  SimulatedTake take = small_take(folder / "broken");
  take.faults = {fault("cam01", 2, FaultKind::kDrop), fault("cam02", 3, FaultKind::kDuplicate),
                 fault("cam03", 4, FaultKind::kSuspect), fault("cam03", 1, FaultKind::kBlack)};
  write(take);
  const take::TakePaths paths{take.folder};
  const take::Ledger ledger = take::load_ledger(paths.ledger());
  EXPECT_FALSE(ledger.complete());
  EXPECT_EQ(ledger.cameras[0].missing, std::vector<int64_t>{2});
  EXPECT_EQ(ledger.cameras[1].duplicate, std::vector<int64_t>{3});
  EXPECT_EQ(ledger.cameras[2].suspect, std::vector<int64_t>{4});
  EXPECT_FALSE(take::FrameLogReader(paths.frames("cam01")).read(2));
  EXPECT_EQ(take::FrameLogReader(paths.frames("cam02")).labels().size(), 6U);
  take::FrameLogReader third(paths.frames("cam03"));
  EXPECT_TRUE(third.labels()[4].suspect);
  EXPECT_THAT(third.read(1)->image.bytes, testing::Each(0));
  EXPECT_THAT(third.read(2)->image.bytes, testing::Contains(testing::Ne(0)));
}

TEST(SimulatedTake, has_earlier_images_only_in_a_late_camera) {
  const TemporaryFolder folder;
  SimulatedTake take = small_take(folder / "late");
  take.faults = {fault("cam02", 3, FaultKind::kLate)};
  write(take);
  const take::TakePaths paths{take.folder};
  take::FrameLogReader late(paths.frames("cam02"));
  EXPECT_NE(late.read(2)->image.bytes, late.read(1)->image.bytes);
  EXPECT_EQ(late.read(3)->image.bytes, late.read(2)->image.bytes);
  EXPECT_NE(late.read(4)->image.bytes, late.read(3)->image.bytes);
  take::FrameLogReader other(paths.frames("cam01"));
  EXPECT_NE(other.read(3)->image.bytes, other.read(2)->image.bytes);
  EXPECT_TRUE(take::load_ledger(paths.ledger()).complete())
      << "the ledger does not contain this fault";
}

TEST(SimulatedTake, has_the_masks_of_the_images_that_a_late_or_black_camera_sends) {
  const TemporaryFolder folder;
  SimulatedTake take = small_take(folder / "late");
  take.mask_dilation_px = 1;
  take.faults = {fault("cam02", 3, FaultKind::kLate), fault("cam03", 2, FaultKind::kBlack)};
  write(take);
  const take::TakePaths paths{take.folder};
  take::FrameLogReader late(paths.frames("cam02"));
  EXPECT_NE(*late.read(2)->mask, *late.read(1)->mask);
  EXPECT_EQ(*late.read(3)->mask, *late.read(2)->mask);
  take::FrameLogReader black(paths.frames("cam03"));
  EXPECT_LT(intersection_over_union(*black.read(2)->mask, *black.read(1)->mask), 0.5);
  EXPECT_GT(intersection_over_union(*black.read(3)->mask, *black.read(1)->mask), 0.5);
}

TEST(SimulatedTake, has_the_lag_of_the_last_late_fault_of_a_camera) {
  const TemporaryFolder folder;
  SimulatedTake take = small_take(folder / "late");
  take.faults = {fault("cam02", 2, FaultKind::kLate), fault("cam02", 4, FaultKind::kLate)};
  take.faults[1].pulses = 3;
  write(take);
  take::FrameLogReader late(take::TakePaths{take.folder}.frames("cam02"));
  EXPECT_EQ(late.read(2)->image.bytes, late.read(1)->image.bytes);
  EXPECT_NE(late.read(3)->image.bytes, late.read(2)->image.bytes);
  EXPECT_EQ(late.read(4)->image.bytes, late.read(1)->image.bytes);
}

TEST(SimulatedTake, writes_the_true_surface_of_every_pulse) {
  const TemporaryFolder folder;
  SimulatedTake take = small_take(folder / "cut");
  take.frames = 2;
  take.truth = folder / "truth";
  write(take);
  EXPECT_TRUE(std::filesystem::exists(folder / "truth/000000.ply"));
  EXPECT_TRUE(std::filesystem::exists(folder / "truth/000001.ply"));
  EXPECT_TRUE(std::filesystem::exists(folder / "truth/sword/000001.ply"));
}

TEST(SimulatedTake, writes_the_true_joints_of_every_pulse) {
  const TemporaryFolder folder;
  SimulatedTake take = small_take(folder / "fight");
  take.frames = 2;
  take.cast = cast_of(2);
  take.truth = folder / "truth";
  write(take);
  const auto truth = nlohmann::json::parse(read_file(folder / "truth/joints.json"));
  const auto& joints = truth["joints"];
  ASSERT_EQ(joints.size(), 34U);
  EXPECT_EQ(
      joints[20],
      (nlohmann::json{
          {"name", "left_shoulder"}, {"parent", 18}, {"main", "left_shoulder"}, {"performer", 2}}));
  ASSERT_EQ(truth["pulses"].size(), 2U);
  EXPECT_EQ(truth["pulses"][1]["pulse"], 1);
  const Pose pose = pose_at(1 / take.rate_hz, take.cast[1].motion);
  const auto& position = truth["pulses"][1]["positions"][20];
  for (int k = 0; k < 3; ++k) {
    EXPECT_NEAR(position[static_cast<size_t>(k)].get<double>(), pose.arm[kLeft].root[k], 1e-6);
  }
}

TEST(SimulatedTake, shows_a_body_from_a_file_and_writes_its_truth) {
  const TemporaryFolder folder;
  SimulatedTake take = small_take(folder / "walk");
  take.frames = 2;
  take.cast[0].model = parse_performer(TinyBody().file(), "tiny.glb", "Walk");
  take.truth = folder / "truth";
  take.outline_noise_px = 0.1;
  write(take);
  const auto frame = take::FrameLogReader(take::TakePaths{take.folder}.frames("cam01")).read(1);
  EXPECT_GT(frame->mask->count(), 30);
  const Mesh surface = read_ply(folder / "truth/000001.ply");
  float top = 0;
  for (const auto& v : surface.vertices) top = std::max(top, v.z());
  EXPECT_NEAR(top, 1.7, 0.06);
  EXPECT_EQ(read_ply(folder / "truth/points/000001.ply").vertices.size(), 20'000U);
  EXPECT_FALSE(std::filesystem::exists(folder / "truth/sword"));
  const auto truth = nlohmann::json::parse(read_file(folder / "truth/joints.json"));
  EXPECT_EQ(truth["joints"][0],
            (nlohmann::json{{"name", "rig:Hips"}, {"parent", -1}, {"main", "pelvis"}}));
  EXPECT_EQ(truth["pulses"][0]["positions"].size(), 3U);
}

TEST(SimulatedTake, writes_the_true_surface_of_each_of_two_performers) {
  const TemporaryFolder folder;
  SimulatedTake take = small_take(folder / "fight");
  take.frames = 1;
  take.cast = cast_of(2);
  take.truth = folder / "truth";
  write(take);
  const Mesh both = read_ply(folder / "truth/000000.ply");
  const Mesh first = read_ply(folder / "truth/performer1/000000.ply");
  const Mesh second = read_ply(folder / "truth/performer2/000000.ply");
  EXPECT_EQ(both.vertices.size(), first.vertices.size() + second.vertices.size());
  const auto is_left = [](const Eigen::Vector3f& v) { return v.x() < 0.3F; };
  EXPECT_TRUE(std::ranges::all_of(first.vertices, is_left));
  EXPECT_FALSE(std::ranges::all_of(second.vertices, is_left));
}

TEST(SimulatedTake, starts_at_the_given_time_of_the_action) {
  const TemporaryFolder folder;
  SimulatedTake take = small_take(folder / "cut"), later = small_take(folder / "later");
  take.truth = folder / "truth";
  later.truth = folder / "truth-later";
  later.begin_s = 2 / take.rate_hz;
  write(take);
  write(later);
  EXPECT_EQ(read_file(folder / "truth-later/000001.ply"), read_file(folder / "truth/000003.ply"));
}

TEST(SimulatedTake, has_masks_with_outline_noise_on_request) {
  const TemporaryFolder folder;
  SimulatedTake take = small_take(folder / "cut");
  take.frames = 1;
  take.outline_noise_px = 1.5;
  write(take);
  const auto frame = take::FrameLogReader(take::TakePaths{take.folder}.frames("cam01")).read(0);
  ASSERT_TRUE(frame && frame->mask);
  const Mask clean = true_silhouette(take.rig[0], 0, take.seed);
  const double iou = intersection_over_union(*frame->mask, clean);
  EXPECT_GT(iou, 0.5);
  EXPECT_LT(iou, 0.95);
}

TEST(SimulatedTake, has_dilated_masks_on_request) {
  const TemporaryFolder folder;
  SimulatedTake take = small_take(folder / "cut");
  take.frames = 1;
  take.mask_dilation_px = 3;
  write(take);
  const auto frame = take::FrameLogReader(take::TakePaths{take.folder}.frames("cam01")).read(0);
  ASSERT_TRUE(frame && frame->mask);
  const Mask loose = dilate(true_silhouette(take.rig[0], 0, take.seed), 3);
  EXPECT_GT(intersection_over_union(*frame->mask, loose), 0.95);
}

TEST(SimulatedTake, rejects_a_used_folder_and_an_invalid_name) {
  const TemporaryFolder folder;
  write(small_take(folder / "cut"));
  EXPECT_THAT(refusal([&] { write(small_take(folder / "cut")); }), HasSubstr("already exists"));
  EXPECT_THAT(refusal([&] { write(small_take(folder / "-cut")); }), HasSubstr("no take name"));
}

}  // namespace
}  // namespace v3d::sim
