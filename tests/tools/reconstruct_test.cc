
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <map>
#include <numbers>
#include <span>

#include "base/config/calib_file.h"
#include "base/core/error.h"
#include "base/core/statistics.h"
#include "base/geometry/rigid_transform.h"
#include "base/image/image_files.h"
#include "base/io/file.h"
#include "codec/byte_stream.h"
#include "common/mesh_formats.h"
#include "daemon/recorded/mesh_frames.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"
#include "support/unreadable_byte.h"
#include "take/logs/mesh_file.h"
#include "take/take.h"
#include "take/take_lock.h"
#include "tools/imported_ball.h"
#include "tools/test_images.h"
#include "v3dctl/evaluate/evaluate.h"
#include "v3dctl/export/mesh_export.h"
#include "v3dctl/import/import.h"
#include "v3dctl/import/media.h"
#include "v3dctl/reconstruct/reconstruct_options.h"
#include "v3dctl/reconstruct/reconstruct_request.h"
#include "v3dctl/reconstruct/take_reconstruction.h"

namespace v3d::ctl {
namespace {

using testing::AllOf;
using testing::HasSubstr;
namespace fs = std::filesystem;

class Reconstruct : public testing::Test {
 protected:
  Reconstruct() {
    request_.take = folder_ / "take";
    test::import_ball(folder_.path(), 8, request_.take);
    request_.bounds = Box{{-0.5, -0.5, -0.5}, {0.5, 0.5, 0.5}};
    request_.voxel_m = 0.02;
    request_.threads = 2;
  }

  void import_as(const std::string& name) {
    ImportOptions import;
    import.take = request_.take = folder_ / name;
    import.calib = folder_ / "calib.toml";
    import.images = folder_ / "images";
    import.masks = folder_ / "masks";
    import_take(import);
  }

  std::string rejection() {
    return test::message_of<InputError>([&] { reconstruct_take(request_); });
  }

  test::TemporaryFolder folder_;
  ReconstructRequest request_;
};

TEST_F(Reconstruct, makes_a_ball_from_eight_views_of_a_ball) {
  const ReconstructReport report = reconstruct_take(request_);
  EXPECT_EQ(report.frames, 1);
  EXPECT_EQ(report.incomplete, 0);
  const double ball = 4.0 / 3 * std::numbers::pi * 0.3 * 0.3 * 0.3;
  EXPECT_GT(median(report.volume_m3), 0.95 * ball);  // a hull contains its object
  EXPECT_LT(median(report.volume_m3), 1.4 * ball);   // and more, for a ring of views
  EXPECT_GT(mean(report.silhouette_iou), 0.85);
  const Mesh mesh = recorded::MeshFrames(request_.take).read(0).mesh;
  EXPECT_EQ(connected_components(mesh), 1);
}

TEST_F(Reconstruct, is_measured_camera_by_camera) {
  const ReconstructReport report = reconstruct_take(request_);
  ASSERT_EQ(report.camera_iou.size(), 8U);
  std::vector<double> all;
  for (const auto& camera : report.camera_iou) all.insert(all.end(), camera.begin(), camera.end());
  EXPECT_EQ(all, report.silhouette_iou);
}

TEST_F(Reconstruct, is_not_measured_outside_the_view_of_the_bounds) {
  request_.bounds = Box{{-0.35, -0.35, -0.35}, {0.35, 0.35, 0.35}};
  const ReconstructReport clean = reconstruct_take(request_);
  Image mask = read_image(folder_ / "masks/b.png");
  for (int y = 0; y < 48; ++y) std::fill_n(mask.row(y), 3 * 5, 255);  // the five leftmost columns
  write_png(folder_ / "masks/b.png", mask.view());
  import_as("cluttered");
  const ReconstructReport cluttered = reconstruct_take(request_);
  EXPECT_EQ(cluttered.camera_iou, clean.camera_iou);
  request_.bounds = Box{{-1.5, -1.5, -0.5}, {1.5, 1.5, 0.5}};
  EXPECT_LT(reconstruct_take(request_).camera_iou[1][0], clean.camera_iou[1][0] - 0.1);
}

TEST_F(Reconstruct, gives_the_same_bytes_for_any_number_of_threads) {
  reconstruct_take(request_);
  const std::string two = read_file(take::TakePaths{request_.take}.mesh());
  request_.threads = 1;
  reconstruct_take(request_);
  EXPECT_EQ(read_file(take::TakePaths{request_.take}.mesh()), two);
}

/// Frames 3 to 6 of a voxel that gets lighter: a key frame and three frames that depend on it.
void write_sequence(const fs::path& file, int64_t left_out = -1) {
  codec::BrickMap occupied;
  occupied.clear({1, 1, 1});
  occupied.word({0, 0, 0}) = 1;
  occupied.number();
  const std::vector<codec::Brick> bricks{codec::Brick{1}};
  const std::vector<codec::BrickCoord> coords{{0, 0, 0}};
  const codec::BrickVolume volume{&occupied, bricks, coords};
  take::MeshFileWriter writer(file);
  codec::FrameEncoder encoder({});
  for (int64_t pulse = 3; pulse <= 6; ++pulse) {
    const auto grey = static_cast<uint8_t>(30 * pulse);
    const std::vector<codec::VertexColour> colours(6, codec::VertexColour{grey, grey, grey});
    codec::FrameContent content;
    content.metadata.pulse = pulse;
    content.metadata.step = 0.01;
    content.volume = &volume;
    content.colours = colours;
    const auto bytes = encoder.encode(content).value();
    if (pulse == left_out) continue;
    EXPECT_TRUE(writer.append(pulse, bytes));
  }
}

TEST_F(Reconstruct, is_read_in_any_order_of_its_frames) {
  write_sequence(take::TakePaths{request_.take}.mesh());
  recorded::MeshFrames rising(request_.take), jumping(request_.take);
  std::map<int64_t, std::vector<Rgb8>> colours;
  for (int64_t frame = 3; frame <= 6; ++frame) colours[frame] = rising.read(frame).mesh.colours;
  EXPECT_NE(colours[3], colours[4]);
  for (const int64_t frame : {5, 3, 6, 6, 4}) {
    EXPECT_EQ(jumping.read(frame).mesh.colours, colours[frame]) << frame;
  }
}

TEST_F(Reconstruct, is_read_with_path_and_cause_of_a_read_error) {
  const std::filesystem::path mesh = take::TakePaths{request_.take}.mesh();
  write_sequence(mesh);
  recorded::MeshFrames meshes(request_.take);
  const test::UnreadableByte bad(16 + 24, mesh.parent_path());  // in the payload of frame 3
  for (const int64_t frame : {3, 4}) {
    EXPECT_EQ(test::message_of<InputError>([&] { meshes.read(frame); }),
              "cannot read " + mesh.string() + ": Input/output error")
        << "frame " << frame << ", which needs frame 3";
  }
}

TEST_F(Reconstruct, is_rejected_without_a_frame_that_another_needs) {
  write_sequence(take::TakePaths{request_.take}.mesh(), 4);
  recorded::MeshFrames meshes(request_.take);
  meshes.read(3);
  EXPECT_THAT(test::message_of<InputError>([&] { meshes.read(5); }),
              HasSubstr("frame 5 is damaged, or of an earlier version: reconstruct"));
}

TEST_F(Reconstruct, leaves_out_the_requested_cameras) {
  request_.leave_out = {"c", "e"};
  const ReconstructReport report = reconstruct_take(request_);
  EXPECT_EQ(report.cameras.size(), 6U);
  EXPECT_THAT(recorded::MeshFrames(request_.take).read(0).cameras,
              testing::Not(testing::Contains("c")));
}

TEST_F(Reconstruct, is_measured_by_a_held_out_camera) {
  request_.leave_out = {"c"};
  reconstruct_take(request_);
  const auto reports = evaluate_held_out({request_.take}, {{"c"}});
  EXPECT_EQ(reports[0].frames, 1);
  EXPECT_GT(reports[0].iou, 0.8);
  EXPECT_GT(reports[0].inside.psnr_db, 10);
  EXPECT_GT(reports[0].whole_mask.psnr_db, 10);
  EXPECT_FALSE(reports[0].true_surface);
}

TEST_F(Reconstruct, is_compared_with_the_true_surface_in_the_same_colours) {
  request_.leave_out = {"c"};
  reconstruct_take(request_);
  fs::create_directories(folder_ / "truth");
  const Mesh mesh = recorded::MeshFrames(request_.take).read(0).mesh;
  const auto figures_of = [&](const Mesh& truth) {
    write_ply(folder_ / "truth/000000.ply", truth);
    return *evaluate_held_out({request_.take}, {.cameras = {"c"}, .truth = folder_ / "truth"})[0]
                .true_surface;
  };
  const auto itself = evaluate_held_out({request_.take}, {{"c"}})[0].inside;
  // The compact frame rounds colours, and the pictures are demosaiced.
  EXPECT_NEAR(figures_of(mesh).psnr_db, itself.psnr_db, 2);
  Mesh aside = mesh;
  for (Eigen::Vector3f& vertex : aside.vertices) vertex.z() += 0.15F;
  EXPECT_LT(figures_of(aside).psnr_db, itself.psnr_db - 3);
}

size_t count_of_pictures(const std::string& page) {
  size_t count = 0;
  for (size_t at = page.find("data:image"); at != std::string::npos;
       at = page.find("data:image", at + 1)) {
    ++count;
  }
  return count;
}

TEST_F(Reconstruct, is_shown_with_the_photograph_and_other_meshes_of_the_take) {
  request_.leave_out = {"c"};
  reconstruct_take(request_);
  fs::copy_file(take::TakePaths{request_.take}.mesh(), folder_ / "other.v3d");
  EvaluationPage page{.columns = {{"mesh.v3d", {request_.take}, {}, {}},
                                  {"other", {request_.take, folder_ / "other.v3d"}, {}, {}}},
                      .truth = {},
                      .held_out = {"c"}};
  for (EvaluationColumn& column : page.columns) {
    column.held_out = evaluate_held_out(column.evaluated, {page.held_out});
  }
  const std::string html = evaluation_html(page);
  EXPECT_EQ(count_of_pictures(html), 5) << "a photograph; twice a rendering and its difference";
  EXPECT_THAT(html, AllOf(HasSubstr("photograph"), HasSubstr("c: PSNR"), HasSubstr("</html>")));
}

TEST_F(Reconstruct, is_coloured_by_its_distance_from_the_truth) {
  reconstruct_take(request_);
  const Mesh mesh = recorded::MeshFrames(request_.take).read(0).mesh;
  Mesh larger = mesh;
  for (Eigen::Vector3f& v : larger.vertices) v *= 1.2F;
  const Image right = error_renderings(mesh, mesh).at(0),
              wrong = error_renderings(larger, mesh).at(0);
  const auto middle = [](const Image& image) {
    const uint8_t* p = image.row(image.size.height / 2) + 3 * (image.size.width / 2);
    return std::pair(p[0], p[2]);
  };
  EXPECT_LT(middle(right).first, middle(right).second) << "blue";
  EXPECT_GT(middle(wrong).first, middle(wrong).second) << "red";
}

TEST_F(Reconstruct, is_not_measured_by_a_camera_that_took_part) {
  reconstruct_take(request_);
  EXPECT_THROW(evaluate_held_out({request_.take}, {{"c"}}), InputError);
  EXPECT_THROW(evaluate_held_out({request_.take}, {{"zoe"}}), InputError);
}

TEST_F(Reconstruct, is_measured_against_the_true_surface) {
  reconstruct_take(request_);
  fs::create_directories(folder_ / "truth");
  write_ply(folder_ / "truth/000000.ply", recorded::MeshFrames(request_.take).read(0).mesh);
  const TruthReport report = evaluate_truth({request_.take}, folder_ / "truth");
  EXPECT_EQ(report.frames, 1);
  EXPECT_LT(report.distance.accuracy_p90_mm, 0.01);
  EXPECT_GT(report.distance.f_score_2mm, 0.999);
  fs::remove(folder_ / "truth/000000.ply");
  EXPECT_THROW(evaluate_truth({request_.take}, folder_ / "truth"), InputError);
}

TEST_F(Reconstruct, is_exported_with_the_colours_of_each_camera) {
  request_.leave_out = {"c"};  // its frames have colours, too
  reconstruct_take(request_);
  const recon::CompactFrame frame = recorded::MeshFrames(request_.take).read(0);
  const std::vector<ExportedCamera> cameras = TakeColours(request_.take).of(frame);
  ASSERT_EQ(cameras.size(), 8U);
  EXPECT_EQ(cameras[2].colours.camera, "c");
  EXPECT_LT((cameras[2].centre + 2 * cameras[2].axis).norm(), 1e-9) << "2 m off, looks at it";
  for (const ExportedCamera& camera : cameras) {
    int64_t seen = 0;
    for (const auto& rgba : camera.colours.vertices) {
      if (rgba[3] != 255) continue;
      ++seen;
      EXPECT_EQ(rgba, (std::array<uint8_t, 4>{200, 120, 40, 255}));
    }
    const auto all = std::ssize(frame.mesh.vertices);
    EXPECT_GT(seen, all / 8) << "not the slanting rest of its side";
    EXPECT_LT(seen, all * 3 / 5) << "one side of it";
  }
}

TEST_F(Reconstruct, has_no_colours_of_cameras_without_raw_frames) {
  reconstruct_take(request_);
  const recon::CompactFrame frame = recorded::MeshFrames(request_.take).read(0);
  const take::TakePaths paths{request_.take};
  for (const char* camera : {"a", "b", "c", "d", "e", "f", "g"}) {
    fs::resize_file(paths.frames(camera), 0);
  }
  const auto blind = TakeColours(request_.take).of(frame).at(0).colours.vertices;
  EXPECT_EQ(blind.size(), frame.mesh.vertices.size());
  EXPECT_TRUE(std::all_of(blind.begin(), blind.end(), [](const auto& c) { return c[3] == 0; }));
  const auto rejection = [&] {
    return test::message_of<InputError>([&] { TakeColours(request_.take).of(frame); });
  };
  fs::resize_file(paths.frames("h"), 0);
  EXPECT_THAT(rejection(), HasSubstr("no raw frames of pulse 0"));
  fs::remove(paths.frames("d"));
  EXPECT_THAT(rejection(), AllOf(HasSubstr("no raw frames of d"), HasSubstr("d.lcmlog")));
}

TEST_F(Reconstruct, has_default_bounds_that_half_the_cameras_see) {
  request_.bounds.reset();
  const Box box = reconstruct_take(request_).bounds;
  EXPECT_TRUE(box.contains({0.3, 0.3, 0.3}));
  EXPECT_TRUE(box.contains({-0.3, -0.3, -0.3}));
  EXPECT_LT(box.size().maxCoeff(), 4.1);
}

TEST_F(Reconstruct, rejects_a_voxel_that_needs_too_much_memory_and_reports_the_calculation) {
  request_.voxel_m = 1e-6;
  EXPECT_THAT(rejection(), HasSubstr("voxel"));
}

TEST_F(Reconstruct, rejects_a_world_whose_origin_is_far_from_the_space) {
  const Eigen::Vector3d far(500'000, 0, 0);
  Rig rig = test::small_rig(8);
  for (RigCamera& camera : rig) {
    RigidTransform pose = camera.model.cam_from_world();
    pose.translation -= pose.rotation * far;
    camera.model = CameraModel(camera.model.size(), camera.model.matrix(), {}, pose);
  }
  save_calib(folder_ / "calib.toml", rig);
  import_as("far");
  request_.bounds = Box{request_.bounds->min + far, request_.bounds->max + far};
  EXPECT_THAT(rejection(), AllOf(HasSubstr("bounds"), HasSubstr("from the origin")));
}

TEST_F(Reconstruct, rejects_an_unknown_camera_to_leave_out_and_leaving_out_all) {
  request_.leave_out = {"zoe"};
  EXPECT_THAT(rejection(), AllOf(HasSubstr("--leave-out zoe"), HasSubstr("a, b, c")));
  request_.leave_out = {"a", "b", "c", "d", "e", "f", "g", "h"};
  EXPECT_THAT(rejection(), HasSubstr("leaves no camera"));
}

TEST_F(Reconstruct, rejects_more_views_than_cameras) {
  request_.min_views = 9;
  EXPECT_THAT(rejection(), AllOf(HasSubstr("--min-views 9"), HasSubstr("8 cameras")));
}

TEST_F(Reconstruct, rejects_frames_that_the_take_does_not_have) {
  request_.frames = {5, 9};
  EXPECT_THAT(rejection(), HasSubstr("--frames"));
}

TEST_F(Reconstruct, rejects_an_empty_take) {
  for (const auto& entry : fs::directory_iterator(request_.take)) {
    const bool is_frames = entry.path().extension() == ".lcmlog";
    if (is_frames) fs::resize_file(entry.path(), 0);
  }
  EXPECT_THAT(rejection(), HasSubstr("no frames"));
}

TEST_F(Reconstruct, rejects_a_folder_that_is_not_a_take) {
  request_.take = folder_ / "images";
  EXPECT_THAT(rejection(), HasSubstr("images"));
}

TEST_F(Reconstruct, rejects_a_take_that_is_being_recorded) {
  const auto lock = take::TakeLock::acquire({request_.take}, "cap01");
  ASSERT_TRUE(lock);
  EXPECT_THAT(rejection(), AllOf(HasSubstr("is being recorded"), HasSubstr("by process ")));
}

TEST_F(Reconstruct, keeps_the_old_meshes_after_an_error) {
  reconstruct_take(request_);
  const std::string old = read_file(take::TakePaths{request_.take}.mesh());
  request_.frames = {5, 9};
  rejection();
  EXPECT_EQ(read_file(take::TakePaths{request_.take}.mesh()), old);
}

TEST_F(Reconstruct, reports_a_missing_camera) {
  const take::TakePaths paths{request_.take};
  fs::resize_file(paths.frames("d"), 0);
  const ReconstructReport report = reconstruct_take(request_);
  EXPECT_EQ(report.frames, 1);
  EXPECT_EQ(report.incomplete, 1);
}

TEST_F(Reconstruct, reports_a_camera_that_the_repair_leaves_out_and_not_as_missing) {
  Image mask = read_image(folder_ / "masks/c.png");
  std::ranges::fill(mask.bytes, uint8_t{0});
  write_png(folder_ / "masks/c.png", mask.view());
  import_as("blind");
  const auto expect_left_out = [&] {
    const ReconstructReport report = reconstruct_take(request_);
    EXPECT_THAT(fault_lines(report.silhouette_faults), testing::Contains("c: left out of 1 frame"));
    EXPECT_EQ(report.incomplete, 0);
  };
  request_.repair = true;
  expect_left_out();
  request_.repair = false;
  request_.repair_pulses = std::vector<int64_t>{0};  // as v3d-recond repaired it
  expect_left_out();
}

/// A key frame with another pulse, below 256.
std::vector<uint8_t> as_key_frame_of(uint8_t pulse, std::vector<uint8_t> frame) {
  for (const size_t field : {24, 40}) frame.at(field) = pulse;
  const uint32_t checksum = codec::crc32(std::span(frame).subspan(16));
  std::memcpy(&frame.at(12), &checksum, sizeof checksum);
  return frame;
}

TEST_F(Reconstruct, names_pulses_whose_live_passes_a_damaged_mesh_does_not_state) {
  const fs::path mesh = take::TakePaths{request_.take}.mesh();
  request_.quality = Quality::kMedium;
  reconstruct_take(request_);
  const std::vector<uint8_t> compact = take::MeshFileReader(mesh).read(0).value().value();
  {
    take::MeshFileWriter file(mesh, take::LogOpening::kContinue);
    ASSERT_TRUE(file.append(1, as_key_frame_of(1, compact)));
    ASSERT_TRUE(file.close());
  }
  ReconstructRequest whole = request_, damaged = request_;
  parse_passes("live", {request_.take}, whole);
  std::string bytes = read_file(mesh);
  bytes.at(16 + 24 + 10) ^= 1;  // in the payload of pulse 0
  test::write_text(mesh, bytes);
  parse_passes("live", {request_.take}, damaged);
  const ReconstructReport report = reconstruct_take(damaged);
  EXPECT_THAT(pulses_with_default_passes(damaged, report), testing::ElementsAre(0));
  EXPECT_THAT(pulses_with_default_passes(whole, report), testing::IsEmpty());
}

TEST(ReconstructReport, has_an_error_of_reading_once_for_all_parts) {
  ReconstructReport whole, part;
  part.read_errors = {"a.lcmlog: Input/output error"};
  append(whole, part);
  part.read_errors.emplace_back("b.lcmlog: Input/output error");
  append(whole, part);
  EXPECT_THAT(whole.read_errors,
              testing::ElementsAre(HasSubstr("a.lcmlog"), HasSubstr("b.lcmlog")));
}

TEST(MinViews, are_four_but_with_few_cameras_all_but_one) {
  EXPECT_EQ(default_min_views(20), 4);
  EXPECT_EQ(default_min_views(5), 4);
  EXPECT_EQ(default_min_views(4), 3);
  EXPECT_EQ(default_min_views(2), 1);
  EXPECT_EQ(default_min_views(1), 1);
}

/// A rig of cameras at these positions that look in one direction.
Rig parallel_rig(const std::vector<Eigen::Vector3d>& positions) {
  const CameraModel lens = test::small_rig(2)[0].model;
  Rig rig;
  for (const Eigen::Vector3d& position : positions) {
    const RigidTransform pose = look_at(position, position + Eigen::Vector3d(0, 3, -0.1));
    rig.push_back(
        {"cam" + std::to_string(rig.size()), CameraModel(lens.size(), lens.matrix(), {}, pose)});
  }
  return rig;
}

TEST(ObservedBounds, are_rejected_for_views_that_do_not_converge) {
  const auto rejection = [](const Rig& rig) {
    return test::message_of<InputError>([&] { default_bounds(rig, 1); });
  };
  EXPECT_THAT(rejection(parallel_rig({{0, 0, 1}, {0.5, 0, 1}, {1, 0, 1}})),
              AllOf(HasSubstr("do not converge"), HasSubstr("--bounds")));
  EXPECT_THAT(rejection(parallel_rig({{0, 0, 1}})),
              AllOf(HasSubstr("one camera limits no space"), HasSubstr("--bounds")));
  Rig diverging = test::small_rig(4);
  for (RigCamera& camera : diverging) {
    const Eigen::Vector3d at = camera.model.center();
    camera.model = CameraModel(camera.model.size(), camera.model.matrix(), {},
                               look_at(at, at - camera.model.viewing_direction()));
  }
  EXPECT_THAT(rejection(diverging), HasSubstr("do not converge"));
}

TEST(ObservedBounds, are_rejected_when_no_point_is_seen_by_enough_cameras) {
  Rig rig = test::small_rig(2);
  const RigidTransform away = look_at({0, 100, 0}, {0, 200, 0});
  rig[1].model = CameraModel(rig[1].model.size(), rig[1].model.matrix(), {}, away);
  EXPECT_THROW(observed_bounds(rig, 2), InputError);
}

}  // namespace
}  // namespace v3d::ctl
