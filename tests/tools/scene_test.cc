// Tests of scene files and of the pictures rendered from them.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "base/core/error.h"
#include "base/image/image_files.h"
#include "base/io/file.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"
#include "tools/gliding_take.h"
#include "tools/test_images.h"
#include "v3dctl/export/mesh_export.h"
#include "v3dctl/scene/scene_file.h"
#include "v3dctl/scene/scene_renderer.h"
#include "v3dctl/scene/scene_video.h"

namespace v3d::ctl {
namespace {

using nlohmann::json;
using testing::HasSubstr;

/// The same cases as in tools/viewer/tests/scene.test.ts.
const json& cases() {
  static const json cases = json::parse(read_file(V3D_SCENE_CASES));
  return cases;
}

Eigen::Vector3d vector(const json& list) {
  return {list[0].get<double>(), list[1].get<double>(), list[2].get<double>()};
}

TEST(SceneFile, contains_the_position_of_every_object) {
  const Scene scene = parse_scene(cases()["scene"].dump(), "takes/duel/scene.json");
  EXPECT_EQ(scene.frames(), cases()["pictures"]);
  EXPECT_EQ(scene.background.colour, (Rgb8{0x0a, 0x1b, 0x2c}));
  EXPECT_EQ(scene.background.sphere, "takes/duel/sky.jpg");
  ASSERT_EQ(scene.takes.size(), 2U);
  EXPECT_EQ(scene.takes[0].take, "takes/a");
  EXPECT_EQ(scene.takes[1].outside, Outside::kHold);
  EXPECT_EQ(scene.takes[0].performer, 2);
  EXPECT_EQ(scene.takes[1].performer, std::nullopt);
  EXPECT_FALSE(scene.takes[0].sound);
  EXPECT_EQ(scene.takes[0].sound_shift_s, 0.25);
  EXPECT_EQ(scene.takes[0].sound_gain_db, -6);
  EXPECT_TRUE(scene.takes[1].sound);
  ASSERT_EQ(scene.models.size(), 1U);
  const Eigen::Vector3d corner = scene.models[0].place.world_from_own() * Eigen::Vector3d(1, 0, 2);
  EXPECT_LT((corner - Eigen::Vector3d(std::sqrt(0.5), std::sqrt(0.5), 2)).norm(), 1e-9);
}

TEST(SceneFile, turns_about_x_then_y_then_z) {
  const Placement place{.move = {1, 0, 0}, .turn_deg = {90, 0, 90}, .scale = 2};
  // Up: about x to -y, about z to +x.
  EXPECT_LT((place.world_from_own() * Eigen::Vector3d(0, 0, 1) - Eigen::Vector3d(3, 0, 0)).norm(),
            1e-9);
}

TEST(SceneFile, names_the_field_that_is_wrong) {
  for (const json& refused : cases()["refused"]) {
    json scene = cases()["scene"];
    scene.merge_patch(refused["with"]);
    try {
      parse_scene(scene.dump(), "duel/scene.json");
      ADD_FAILURE() << "accepted " << refused;
    } catch (const InputError& error) {
      EXPECT_THAT(error.what(),
                  HasSubstr("duel/scene.json: " + refused["says"].get<std::string>()));
    }
  }
  EXPECT_THROW(parse_scene("{", "scene.json"), InputError);
  EXPECT_THROW(parse_scene("[]", "scene.json"), InputError);
}

TEST(SceneClock, moves_the_camera_through_its_keys) {
  const Scene scene = parse_scene(cases()["scene"].dump(), "scene.json");
  for (const json& wanted : cases()["cameras"]) {
    const CameraKey key = camera_at(scene.camera, wanted["at_s"]);
    EXPECT_LT((key.eye - vector(wanted["eye"])).norm(), 1e-9) << wanted;
    EXPECT_LT((key.look - vector(wanted["look"])).norm(), 1e-9) << wanted;
    EXPECT_NEAR(key.fov_deg, wanted["fov_deg"], 1e-9) << wanted;
  }
}

TEST(SceneClock, shifts_and_stretches_takes) {
  SceneTake take = parse_scene(cases()["scene"].dump(), "scene.json").takes[0];
  for (const json& wanted : cases()["pulses"]) {
    const std::string outside = wanted["outside"];
    take.outside = outside == "hold"   ? Outside::kHold
                   : outside == "hide" ? Outside::kHide
                                       : Outside::kLoop;
    const auto pulse = pulse_at(take, 25, 0, 99, wanted["at_s"]);
    EXPECT_EQ(pulse ? json(*pulse) : json(), wanted["pulse"]) << wanted;
  }
}

/// A cube of 40 cm on the floor, red, as a model; glTF has y up.
Mesh red_cube() {
  Mesh cube;
  for (int i = 0; i < 8; ++i) {
    cube.vertices.emplace_back(i & 1 ? 0.2F : -0.2F, i & 2 ? 0.2F : -0.2F, i & 4 ? 0.4F : 0.0F);
  }
  cube.triangles = {{0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}, {0, 1, 5}, {0, 5, 4},
                    {2, 6, 7}, {2, 7, 3}, {0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}};
  cube.colours.assign(8, {200, 20, 20});
  return cube;
}

class ScenePictures : public testing::Test {
 protected:
  ScenePictures() {
    write_mesh(folder_ / "cube.glb", MeshFormat::kGlb, red_cube());
    Image sky({4, 2}, PixelFormat::kRGB8);
    for (int x = 0; x < 4; ++x) {
      for (int y = 0; y < 2; ++y)
        sky.row(y)[3 * x + (x < 2 ? 1 : 2)] = 250;  // left green, right blue
    }
    write_png(folder_ / "sky.png", sky.view());
  }

  /// One picture of 64 x 48 from 2 m before the cube, towards +y.
  Image picture_of(const char* changes) {
    json scene = json::parse(R"({"v3d_scene": 1, "seconds": 1, "models": [{"model": "cube.glb"}],
        "camera": {"keys": [{"at_s": 0, "eye": [0, -2, 0.2], "look": [0, 0, 0.2]}]}})");
    scene.merge_patch(json::parse(changes));
    return SceneRenderer(parse_scene(scene.dump(), folder_ / "scene.json"), {.size = {64, 48}})
        .draw(0);
  }
  static Rgb8 pixel(const Image& image, int x, int y) {
    const uint8_t* p = image.row(y) + 3 * x;
    return {p[0], p[1], p[2]};
  }

  const test::TemporaryFolder folder_;
};

TEST_F(ScenePictures, show_models_at_their_positions) {
  const Image image = picture_of(R"({"background": {"colour": "#010203"}})");
  EXPECT_EQ(pixel(image, 32, 24), (Rgb8{200, 20, 20})) << "unlit: as it is";
  EXPECT_EQ(pixel(image, 4, 24), (Rgb8{1, 2, 3}));
  const Image aside = picture_of(R"({"models": [{"model": "cube.glb", "move": [-0.7, 0, 0]}]})");
  EXPECT_EQ(pixel(aside, 32, 24), (Rgb8{16, 18, 22}));
  EXPECT_EQ(pixel(aside, 4, 24), (Rgb8{200, 20, 20}));
}

/// A take of a red cube at the left, which is performer 1, and a blue one, performer 2.
void write_two_cubes(const std::filesystem::path& take) {
  const Mesh cube = red_cube();
  Mesh both;
  std::vector<uint8_t> labels;
  for (const float x : {-0.7F, 0.7F}) {
    const auto first = static_cast<uint32_t>(both.vertices.size());
    for (const Eigen::Vector3f& vertex : cube.vertices) {
      both.vertices.emplace_back(vertex + Eigen::Vector3f(x, 0, 0));
      both.colours.push_back(x < 0 ? Rgb8{200, 20, 20} : Rgb8{20, 20, 200});
      labels.push_back(x < 0 ? uint8_t{1} : uint8_t{2});
    }
    for (const auto& [a, b, c] : cube.triangles) {
      both.triangles.push_back({first + a, first + b, first + c});
    }
  }
  test::write_gliding_take(take);
  test::write_still_meshes(take, both, labels);
}

TEST_F(ScenePictures, show_one_performer_of_a_take) {
  write_two_cubes(folder_ / "take");
  const auto cubes = [&](const std::string& performer) {
    const Image image = picture_of((R"({"models": [], "background": {"colour": "#000000"},
        "takes": [{"take": "take")" +
                                    performer + "}]}")
                                       .c_str());
    // The columns of the left and of the right cube.
    return std::pair(pixel(image, 9, 24).r > 150, pixel(image, 54, 24).b > 150);
  };
  EXPECT_EQ(cubes(""), std::pair(true, true));
  EXPECT_EQ(cubes(R"(, "performer": 1)"), std::pair(true, false));
  EXPECT_EQ(cubes(R"(, "performer": 2)"), std::pair(false, true));
}

TEST_F(ScenePictures, have_a_panorama_as_background) {
  // Towards +y is the left half, left of it -x is the left edge, and right of it +x the middle.
  const Image image = picture_of(R"({"background": {"sphere": "sky.png"}})");
  EXPECT_EQ(pixel(image, 2, 2), (Rgb8{0, 250, 0}));
  const Image turned = picture_of(R"({"background": {"sphere": "sky.png", "turn_deg": 180}})");
  EXPECT_EQ(pixel(turned, 2, 2), (Rgb8{0, 0, 250}));
}

TEST_F(ScenePictures, have_a_still_picture_as_background_that_fills_them) {
  const Image image = picture_of(R"({"background": {"image": "sky.png"}})");
  EXPECT_EQ(pixel(image, 2, 2), (Rgb8{0, 250, 0}));
  EXPECT_EQ(pixel(image, 61, 46), (Rgb8{0, 0, 250}));
}

TEST_F(ScenePictures, name_a_missing_file) {
  for (const char* changes :
       {R"({"models": [{"model": "none.glb"}]})", R"({"models": [{"model": "sky.png"}]})",
        R"({"background": {"image": "cube.glb"}})", R"({"takes": [{"take": "../none"}]})"}) {
    EXPECT_THROW(picture_of(changes), InputError) << changes;
  }
}

TEST_F(ScenePictures, become_a_video_with_a_video_as_background) {
  if (std::system("command -v ffmpeg >/dev/null") != 0) GTEST_SKIP() << "there is no ffmpeg";
  VideoWriter video(folder_ / "street.mp4", {64, 48}, 25);
  for (const uint8_t grey : {40, 120, 200}) {
    Image picture({64, 48}, PixelFormat::kRGB8);
    std::ranges::fill(picture.bytes, grey);
    video.add(picture);
  }
  video.close();
  VideoReader reader(folder_ / "street.mp4", {32, 24}, 25);
  EXPECT_NEAR(pixel(reader.picture(0), 16, 12).g, 40, 3);
  EXPECT_NEAR(pixel(reader.picture(2), 16, 12).g, 200, 3);
  EXPECT_NEAR(pixel(reader.picture(9), 16, 12).g, 200, 3) << "the last stays";
  const Image scene = picture_of(R"({"background": {"video": "street.mp4"}})");
  EXPECT_NEAR(pixel(scene, 2, 2).r, 40, 3);
  EXPECT_EQ(pixel(scene, 32, 24), (Rgb8{200, 20, 20}));
  VideoReader none(folder_ / "cube.glb", {32, 24}, 25);
  EXPECT_THROW(none.picture(0), InputError);
}

TEST_F(ScenePictures, leave_an_earlier_video_until_the_new_one_is_complete) {
  if (std::system("command -v ffmpeg >/dev/null") != 0) GTEST_SKIP() << "there is no ffmpeg";
  replace_file(folder_ / "duel.mp4", "earlier");
  const auto entries = [&] {
    return std::distance(std::filesystem::directory_iterator(folder_.path()),
                         std::filesystem::directory_iterator());
  };
  const auto before = entries();
  const Image picture({64, 48}, PixelFormat::kRGB8);
  {
    VideoWriter given_up(folder_ / "duel.mp4", {64, 48}, 25);
    given_up.add(picture);
  }
  EXPECT_EQ(read_file(folder_ / "duel.mp4"), "earlier");
  EXPECT_EQ(entries(), before);
  VideoWriter video(folder_ / "duel.mp4", {64, 48}, 25);
  video.add(picture);
  video.close();
  EXPECT_GT(std::filesystem::file_size(folder_ / "duel.mp4"), 100U);
  EXPECT_EQ(entries(), before);
}

TEST_F(ScenePictures, reject_a_background_video_whose_size_changes) {
  if (std::system("command -v ffmpeg >/dev/null") != 0) GTEST_SKIP() << "there is no ffmpeg";
  std::string motion_jpeg;
  for (const ImageSize size : {ImageSize{64, 48}, {64, 48}, {32, 24}}) {
    test::write_jpeg(folder_ / "frame.jpg", Image(size, PixelFormat::kRGB8));
    motion_jpeg += read_file(folder_ / "frame.jpg");
  }
  replace_file(folder_ / "street.mjpeg", motion_jpeg);
  EXPECT_THAT(test::message_of<InputError>(
                  [&] { picture_of(R"({"background": {"video": "street.mjpeg"}})"); }),
              HasSubstr("street.mjpeg frame 2: is 32x24, but the frames before are 64x48"));
}

TEST(ProcessStream, reports_when_the_other_program_no_longer_reads) {
  ProcessStream gone({"true"}, ProcessStream::End::kStdin);
  const std::vector<uint8_t> bytes(1 << 20);
  while (gone.write(bytes)) {
  }
  EXPECT_EQ(gone.finish(), 0);
  EXPECT_THROW(ProcessStream({"v3d-none"}, ProcessStream::End::kStdin), InputError);
}

TEST(ProcessStream, returns_the_output_of_the_other_program) {
  ProcessStream said({"echo", "takes"}, ProcessStream::End::kStdout);
  std::vector<uint8_t> bytes(5);
  EXPECT_TRUE(said.read(bytes));
  EXPECT_EQ(std::string(bytes.begin(), bytes.end()), "takes");
  EXPECT_FALSE(said.read(bytes)) << "there is no more than the end of the line";
}

TEST_F(ScenePictures, light_models_from_above) {
  ModelSurface model;
  model.mesh.vertices.assign(2, Eigen::Vector3f::Zero());
  model.normals = {Eigen::Vector3f::UnitZ(), -Eigen::Vector3f::UnitZ()};
  model.albedo.assign(2, Eigen::Vector3f::Constant(0.5F));
  model.unlit = {0, 0};
  const Mesh lit = lit_model(model, Eigen::Affine3d::Identity());
  EXPECT_GT(lit.colours[0].r, lit.colours[1].r + 60);
}

}  // namespace
}  // namespace v3d::ctl
