// Vertex colours of recorded takes by camera, as HTTP responses.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "base/config/calib_file.h"
#include "daemon/viewd/take_pictures.h"
#include "take/logs/frame_log.h"
#include "take/logs/mesh_file.h"
#include "tests/codec/coded_scene.h"
#include "viewed_site.h"

namespace v3d::viewd {
namespace {

using test::field;
using test::write;
using testing::HasSubstr;
using testing::Not;

/// A ball of 40 cm between two cameras with images of different colours, and a pulse without a
/// mesh.
class ViewedBall : public test::ViewedSite {
 protected:
  static constexpr ImageSize kSize{160, 120};
  static constexpr Rgb8 kLeft{200, 40, 30}, kRight{20, 60, 220};

  ViewedBall() {
    const take::TakePaths paths{folder_ / "takes/kendo-07"};
    save_info({"left", "right"});
    save_calib(paths.calib(), {camera("left", {-3, 0, 1}), camera("right", {3, 0, 1})});
    save_frames(paths, "left", kLeft);
    save_frames(paths, "right", kRight);
    save_meshes(paths.mesh());
  }

  static RigCamera camera(const std::string& name, const Eigen::Vector3d& eye) {
    Eigen::Matrix3d matrix;
    matrix << 200, 0, 79.5, 0, 200, 59.5, 0, 0, 1;
    return {.name = name, .model = {kSize, matrix, {}, look_at(eye, {0, 0, 1})}, .colour = {}};
  }
  static void save_frames(const take::TakePaths& paths, const std::string& camera, Rgb8 colour) {
    std::filesystem::remove(paths.frames(camera));
    take::EventLogWriter log(paths.frames(camera));
    for (int64_t pulse = 0; pulse < 3; ++pulse) {
      wire::FrameMessage message;
      message.frame.camera = camera;
      message.frame.label.pulse = pulse;
      message.frame.sensor_size = kSize;
      message.frame.roi = {0, 0, kSize.width, kSize.height};
      message.frame.image = Image(kSize, PixelFormat::kRGB8);
      for (int64_t n = 0; n < kSize.pixels(); ++n) {
        uint8_t* rgb = message.frame.image.bytes.data() + 3 * n;
        rgb[0] = colour.r, rgb[1] = colour.g, rgb[2] = colour.b;
      }
      message.frame.mask = Mask(kSize);
      for (int y = 0; y < kSize.height; ++y) message.frame.mask->fill_row(y, 0, kSize.width);
      ASSERT_TRUE(log.write(message));
    }
    ASSERT_TRUE(log.sync());
  }
  void save_meshes(const std::filesystem::path& path) {
    codec::Scene scene(codec::ball(20));
    scene.colours.assign(scene.mesh.vertices.size(), codec::VertexColour{1, 2, 3});
    vertices_ = static_cast<int64_t>(scene.mesh.vertices.size());
    codec::FrameEncoder encoder({.key_every = 10});
    std::filesystem::remove(path);  // the default one is not a mesh file
    take::MeshFileWriter file(path);
    for (const int64_t pulse : {0, 2}) {
      codec::FrameContent content = scene.content(pulse);
      const double half = 25 * scene.volume.grid().voxel_m;
      content.metadata.origin = {-half, -half, 1 - half};
      content.metadata.cameras = {"left", "right"};
      EXPECT_TRUE(file.append(pulse, *encoder.encode(content)));
    }
    EXPECT_TRUE(file.close());
  }

  int64_t vertices_ = 0;
};

/// The message, parsed like in the page.
struct ReadViews {
  nlohmann::json head;
  struct Camera {
    std::vector<int> visibility;
    std::vector<Rgb8> colours;  ///< of the visible vertices
  };
  std::vector<Camera> cameras;
  bool whole = false;

  explicit ReadViews(const std::string& message) {
    const auto byte = [&](size_t at) { return static_cast<uint8_t>(message.at(at)); };
    const size_t length = byte(0) + 256U * byte(1) + 65536U * byte(2);
    head = nlohmann::json::parse(message.substr(4, length));
    size_t at = 4 + length;
    const size_t vertices = head["vertices"];
    for (size_t c = 0; c < head["cameras"].size(); ++c) {
      Camera camera;
      const size_t visibility_begin = at;
      at += (vertices + 3) / 4;
      for (size_t v = 0; v < vertices; ++v) {
        camera.visibility.push_back(byte(visibility_begin + v / 4) >> (2 * (v % 4)) & 3);
        if (camera.visibility.back() == 0) continue;
        camera.colours.push_back({byte(at), byte(at + 1), byte(at + 2)});
        at += 3;
      }
      cameras.push_back(std::move(camera));
    }
    whole = at == message.size();
  }
};

TEST_F(ViewedBall, has_the_colours_of_each_camera_on_its_side) {
  const web::WebResponse response = get("/api/takes/kendo-07/views/2");
  ASSERT_EQ(response.status, 200) << response.body;
  const ReadViews views(response.body);
  EXPECT_TRUE(views.whole);
  EXPECT_EQ(views.head["pulse"], 2);
  EXPECT_EQ(views.head["vertices"], vertices_);
  ASSERT_EQ(views.cameras.size(), 2U);
  EXPECT_EQ(views.head["cameras"][0]["name"], "left");
  EXPECT_NEAR(views.head["cameras"][0]["axis"][0], 1, 1e-9);
  EXPECT_NEAR(views.head["cameras"][1]["axis"][0], -1, 1e-9);
  for (const auto& [camera, colour] : {std::pair(0, kLeft), {1, kRight}}) {
    const auto& seen = views.cameras[camera].colours;
    EXPECT_EQ(std::ranges::count(seen, colour), std::ssize(seen));
    EXPECT_GT(std::ssize(seen), vertices_ / 4);
  }
  int64_t both = 0;
  for (int64_t v = 0; v < vertices_; ++v) {
    both += views.cameras[0].visibility[v] != 0 && views.cameras[1].visibility[v] != 0;
  }
  EXPECT_LT(both, vertices_ / 20) << "they stand on opposite sides, and share its edge alone";
}

TEST_F(ViewedBall, does_not_depend_on_previous_requests) {
  WebSite site = this->site();
  const auto ask = [&](int pulse) {
    return done(site.respond({.method = "GET",
                              .target = "/api/takes/kendo-07/views/" + std::to_string(pulse),
                              .host = "localhost"}));
  };
  const std::string last = ask(2).body, first = ask(0).body;
  EXPECT_EQ(ask(2).body, last);
  EXPECT_EQ(get("/api/takes/kendo-07/views/0").body, first);
}

TEST_F(ViewedBall, changes_its_etag_only_with_its_files) {
  WebSite site = this->site();
  web::WebRequest request{
      .method = "GET", .target = "/api/takes/kendo-07/views/0", .host = "localhost"};
  request.if_none_match = field(done(site.respond(request)), "ETag");
  EXPECT_EQ(done(site.respond(request)).status, 304);
  save_frames(take::TakePaths{folder_ / "takes/kendo-07"}, "left", kRight);
  const web::WebResponse changed = done(site.respond(request));
  ASSERT_EQ(changed.status, 200);
  EXPECT_EQ(ReadViews(changed.body).cameras[0].colours.front(), kRight);
}

TEST_F(ViewedBall, answers_404_without_frames_and_outside_the_takes) {
  for (const char* target :
       {"/api/takes/kendo-07/views/1", "/api/takes/kendo-07/views/-1",
        "/api/takes/kendo-07/views/x", "/api/takes/kendo-07/views", "/api/takes/none/views/0",
        "/api/takes/%2e%2e/views/0", "/api/takes/-x/views/0"}) {
    const web::WebResponse response = get(target);
    EXPECT_THAT(response.status, testing::AnyOf(404, 400)) << target;
    EXPECT_EQ(std::ranges::count(response.body, '\n'), 1) << response.body;
    EXPECT_THAT(response.body, Not(HasSubstr(folder_.path().string())));
  }
  std::filesystem::remove(folder_ / "takes/kendo-07/left.lcmlog");
  EXPECT_THAT(get("/api/takes/kendo-07/views/0").body, HasSubstr("raw frames are not here"));
}

TEST_F(ViewedBall,
       is_listed_without_a_number_of_meshes_and_without_a_path_when_its_mesh_is_damaged) {
  write(folder_ / "takes/kendo-07/mesh.v3d", "");
  const std::string listing = get("/api/takes").body;
  const nlohmann::json take = nlohmann::json::parse(listing).at("takes").at(0);
  EXPECT_TRUE(take.at("meshes").is_null()) << listing;
  EXPECT_THAT(take.at("mesh_error"), HasSubstr("mesh.v3d cannot be read"));
  EXPECT_THAT(listing, Not(HasSubstr(folder_.path().string())));
}

TEST_F(ViewedBall, survives_damaged_files_and_does_not_report_them_as_missing) {
  write(folder_ / "takes/kendo-07/right.lcmlog", std::string(5000, 'x'));
  EXPECT_EQ(get("/api/takes/kendo-07/views/0").status, 500);
  write(folder_ / "takes/kendo-07/mesh.v3d", std::string(5000, 'x'));
  EXPECT_EQ(get("/api/takes/kendo-07/views/0").status, 500);
  write(folder_ / "takes/kendo-07/take.toml", "name = ");
  EXPECT_EQ(get("/api/takes/kendo-07/views/0").status, 500);
}

TEST_F(ViewedBall, keeps_no_file_of_a_take_open_that_is_removed_or_long_unused) {
  TakeViews views(folder_ / "takes");
  EXPECT_TRUE(views.read("kendo-07", 2));
  views.close_unused(Monotonic::now());
  EXPECT_THAT(test::open_files_in(folder_.path()), testing::SizeIs(3)) << "two logs and the meshes";
  views.close_unused(Monotonic::now() + 2 * kMaxUnused);
  EXPECT_THAT(test::open_files_in(folder_.path()), testing::IsEmpty());
  for (const char* file : {"right.lcmlog", "mesh.v3d"}) {
    EXPECT_TRUE(views.read("kendo-07", 2));
    std::filesystem::remove(folder_ / "takes/kendo-07" / file);
    views.close_unused(Monotonic::now());
    EXPECT_THAT(test::open_files_in(folder_.path()), testing::IsEmpty()) << file;
    save_frames(take::TakePaths{folder_ / "takes/kendo-07"}, "right", kRight);
  }
}

}  // namespace
}  // namespace v3d::viewd
