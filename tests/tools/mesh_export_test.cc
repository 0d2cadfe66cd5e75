#include "v3dctl/export/mesh_export.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck.h>

#include <Eigen/Geometry>
#include <cmath>

#include "base/core/error.h"
#include "base/io/file.h"
#include "common/mesh_formats.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"
#include "tools/glb.h"

namespace v3d::ctl {
namespace {

using nlohmann::json;
using test::Glb;
using test::parse_glb;
using testing::HasSubstr;

Mesh tetrahedron() {
  Mesh mesh;
  mesh.vertices = {{0, 0, 0}, {1, 0, 0}, {0, 2, 0}, {0, 0, -3.5F}};
  mesh.triangles = {{0, 1, 2}, {0, 3, 1}, {0, 2, 3}, {1, 3, 2}};
  mesh.colours = {{255, 0, 0}, {0, 255, 0}, {0, 0, 255}, {188, 1, 0}};
  return mesh;
}

void expect_equal(const Mesh& a, const Mesh& b) {
  EXPECT_EQ(a.vertices, b.vertices);
  EXPECT_EQ(a.triangles, b.triangles);
  EXPECT_EQ(a.colours, b.colours);
}

class MeshExport : public testing::Test {
 protected:
  std::string written(MeshFormat format, const Mesh& mesh) {
    write_mesh(folder_ / "mesh", format, mesh);
    return read_file(folder_ / "mesh");
  }
  test::TemporaryFolder folder_;
};

TEST_F(MeshExport, ply_reads_back_to_the_bit) {
  written(MeshFormat::kPly, tetrahedron());
  expect_equal(read_ply(folder_ / "mesh"), tetrahedron());
}

TEST_F(MeshExport, ply_of_a_mesh_without_colours_has_none) {
  Mesh mesh = tetrahedron();
  mesh.colours.clear();
  EXPECT_EQ(written(MeshFormat::kPly, mesh).find("red"), std::string::npos);
  expect_equal(read_ply(folder_ / "mesh"), mesh);
}

TEST_F(MeshExport, obj_counts_vertices_from_one_and_puts_colours_behind_positions) {
  const std::string text = written(MeshFormat::kObj, tetrahedron());
  EXPECT_THAT(text, HasSubstr("v 0 0 -3.5 0.737255 0.00392157 0\n"));
  EXPECT_THAT(text, HasSubstr("f 1 2 3\n"));
  EXPECT_THAT(text, HasSubstr("f 2 4 3\n"));
}

TEST_F(MeshExport, glb_has_valid_chunks_and_aligned_views) {
  const Glb glb = parse_glb(written(MeshFormat::kGlb, tetrahedron()));
  EXPECT_EQ(glb.scene["asset"]["version"], "2.0");
  EXPECT_LE(glb.scene["buffers"][0]["byteLength"].get<size_t>(), glb.buffer.size());
  for (const json& view : glb.scene["bufferViews"]) {
    EXPECT_EQ(view.value("byteOffset", 0) % 4, 0);
    EXPECT_LE(view.value("byteOffset", 0) + view["byteLength"].get<size_t>(), glb.buffer.size());
  }
}

TEST_F(MeshExport, glb_contains_the_bounds_of_its_positions) {
  const json scene = parse_glb(written(MeshFormat::kGlb, tetrahedron())).scene;
  const json& primitive = scene["meshes"][0]["primitives"][0];
  const json& position = scene["accessors"][primitive["attributes"]["POSITION"].get<size_t>()];
  EXPECT_EQ(position["min"], json({0.0, 0.0, -3.5}));
  EXPECT_EQ(position["max"], json({1.0, 2.0, 0.0}));
  EXPECT_EQ(position["count"], 4);
  EXPECT_EQ(scene["accessors"][primitive["indices"].get<size_t>()]["count"], 12);
}

TEST_F(MeshExport, glb_colours_are_linear_light) {
  const Glb glb = parse_glb(written(MeshFormat::kGlb, tetrahedron()));
  const json& primitive = glb.scene["meshes"][0]["primitives"][0];
  const json& colour = glb.scene["accessors"][primitive["attributes"]["COLOR_0"].get<size_t>()];
  EXPECT_EQ(colour["componentType"], 5123);
  EXPECT_TRUE(colour["normalized"].get<bool>());
  const size_t offset = glb.scene["bufferViews"][colour["bufferView"].get<size_t>()]["byteOffset"];
  uint16_t rgba[16];
  std::memcpy(rgba, glb.buffer.data() + offset, sizeof rgba);
  EXPECT_EQ(rgba[0], 65535);                      // sRGB 255
  EXPECT_NEAR(rgba[12] / 65535.0, 0.5029, 2e-3);  // sRGB 188 is half the light
  EXPECT_NEAR(rgba[13] / 65535.0, 1 / 255.0 / 12.92, 1e-5);
}

TEST_F(MeshExport, glb_has_y_up) {
  const json rotation =
      parse_glb(written(MeshFormat::kGlb, tetrahedron())).scene["nodes"][0]["rotation"];
  const Eigen::Quaterniond q(rotation[3].get<double>(), rotation[0].get<double>(),
                             rotation[1].get<double>(), rotation[2].get<double>());
  EXPECT_LT((q * Eigen::Vector3d::UnitZ() - Eigen::Vector3d::UnitY()).norm(), 1e-12);
}

ExportedCamera camera_that_saw(const std::string& name, size_t vertices) {
  ExportedCamera camera{.colours = {name, {}}, .centre = {1, -2.5, 3}, .axis = {0, 1, 0}};
  for (size_t v = 0; v < vertices; ++v) {
    camera.colours.vertices.push_back({static_cast<uint8_t>(v), 20, 30, 255});
  }
  return camera;
}

TEST_F(MeshExport, glb_has_pulse_and_timecode_where_they_are_known) {
  EXPECT_FALSE(test::parse_glb(written(MeshFormat::kGlb, tetrahedron()))
                   .scene["nodes"][0]
                   .contains("extras"));
  const take::PulseTimecode timecode{.rate = sound::TimecodeRate::k25, .frames = 900'012.25};
  write_mesh(folder_ / "mesh", MeshFormat::kGlb, tetrahedron(), {.pulse = 7, .timecode = timecode});
  const auto extras = test::parse_glb(read_file(folder_ / "mesh")).scene["nodes"][0]["extras"];
  EXPECT_EQ(extras["pulse"], 7);
  EXPECT_EQ(extras["timecode"], "10:00:00:12");
  EXPECT_EQ(extras["timecode_rate"], "25");
}

TEST_F(MeshExport, ply_has_the_colours_of_each_camera_after_the_vertex_colours) {
  const Mesh mesh = tetrahedron();
  const std::vector<ExportedCamera> cameras{camera_that_saw("cam01", 4), camera_that_saw("a b", 4)};
  write_mesh(folder_ / "mesh", MeshFormat::kPly, mesh, {.cameras = cameras});
  const std::string text = read_file(folder_ / "mesh");
  EXPECT_THAT(text, HasSubstr("comment cam01 stands at 1 -2.5 3 and looks along 0 1 0\n"));
  EXPECT_THAT(text, HasSubstr("property uchar blue\nproperty uchar cam01_red\nproperty uchar "
                              "cam01_green\nproperty uchar cam01_blue\nproperty uchar "
                              "cam01_sight\nproperty uchar a_b_red\n"));
  const size_t last = text.find("end_header\n") + 11 + 3 * (12 + 3 + 8);  // the last vertex
  EXPECT_EQ(text.substr(last + 15, 8), std::string("\x03\x14\x1e\xff\x03\x14\x1e\xff"));
  expect_equal(read_ply(folder_ / "mesh"), mesh);
}

TEST_F(MeshExport, glb_has_the_colours_and_the_position_of_each_camera) {
  const std::vector<ExportedCamera> cameras{camera_that_saw("cam01", 4)};
  write_mesh(folder_ / "mesh", MeshFormat::kGlb, tetrahedron(), {.cameras = cameras});
  const Glb glb = parse_glb(read_file(folder_ / "mesh"));
  const json& accessor = glb.accessor("_CAM01_COLOR");
  EXPECT_EQ(accessor["componentType"], 5121);
  EXPECT_EQ(accessor["type"], "VEC4");
  EXPECT_TRUE(accessor["normalized"].get<bool>());
  const size_t at = glb.scene["bufferViews"][accessor["bufferView"].get<size_t>()]["byteOffset"];
  EXPECT_EQ(glb.buffer.substr(at + 12, 4), "\x03\x14\x1e\xff");
  const json& camera = glb.scene["meshes"][0]["extras"]["cameras"][0];
  EXPECT_EQ(camera["name"], "cam01");
  EXPECT_EQ(camera["attribute"], "_CAM01_COLOR");
  EXPECT_EQ(camera["centre"], json({1.0, -2.5, 3.0}));
  EXPECT_EQ(camera["axis"], json({0.0, 1.0, 0.0}));
}

TEST_F(MeshExport, removes_vertices_that_no_triangle_uses_in_every_camera) {
  Mesh mesh = tetrahedron();
  mesh.triangles = {{3, 1, 2}, {2, 1, 3}};
  std::vector<ExportedCamera> cameras(1);
  cameras[0].colours.vertices = {{1, 0, 0, 255}, {2, 0, 0, 255}, {3, 0, 0, 255}, {4, 0, 0, 255}};
  remove_unused_vertices(mesh, cameras);
  const Mesh whole = tetrahedron();
  EXPECT_EQ(mesh.vertices, std::vector(whole.vertices.begin() + 1, whole.vertices.end()));
  EXPECT_EQ(mesh.colours, std::vector(whole.colours.begin() + 1, whole.colours.end()));
  EXPECT_EQ(mesh.triangles, (std::vector<std::array<uint32_t, 3>>{{2, 0, 1}, {1, 0, 2}}));
  EXPECT_EQ(cameras[0].colours.vertices.front()[0], 2);
  EXPECT_EQ(cameras[0].colours.vertices.size(), 3U);
}

TEST_F(MeshExport, rejects_content_that_a_format_cannot_store) {
  EXPECT_THAT(test::message_of<InputError>(
                  [] { check_options(MeshFormat::kPly, Compression::kDraco, false, false); }),
              HasSubstr("--compress"));
  EXPECT_THAT(test::message_of<InputError>(
                  [] { check_options(MeshFormat::kObj, Compression::kNone, true, false); }),
              HasSubstr("--view-dependent"));
  EXPECT_NO_THROW(check_options(MeshFormat::kGlb, Compression::kMeshopt, true, false));
  EXPECT_NO_THROW(check_options(MeshFormat::kPly, Compression::kNone, true, false));
  EXPECT_THROW(parse_compression("zip"), InputError);
}

TEST_F(MeshExport, an_empty_mesh_is_a_valid_file_of_every_format) {
  EXPECT_EQ(parse_glb(written(MeshFormat::kGlb, {})).scene.value("meshes", json::array()).size(),
            0U);
  written(MeshFormat::kPly, {});
  EXPECT_TRUE(read_ply(folder_ / "mesh").vertices.empty());
  EXPECT_THAT(written(MeshFormat::kObj, {}), testing::Not(HasSubstr("v ")));
}

TEST_F(MeshExport, rejects_an_unknown_format) {
  EXPECT_THROW(parse_mesh_format("stl"), InputError);
  EXPECT_THROW(parse_mesh_format(""), InputError);
}

TEST(PerformerFilter, leaves_a_pulse_without_a_surface_empty) {
  std::vector<ExportedCamera> cameras;
  PerformerFilter filter("take", 2);
  recon::CompactFrame frame;
  filter.apply(frame, cameras);
  EXPECT_TRUE(frame.mesh.vertices.empty());
  EXPECT_FALSE(filter.is_present());
  frame.pulse = 3;
  frame.mesh = tetrahedron();
  EXPECT_THAT(test::message_of<InputError>([&] { filter.apply(frame, cameras); }),
              HasSubstr("frame 3 does not state performers"));
  frame.performers.assign(4, 2);
  filter.apply(frame, cameras);
  EXPECT_TRUE(filter.is_present());
}

class PlyReader : public MeshExport {
 protected:
  Mesh read(const std::string& bytes) {
    replace_file(folder_ / "mesh.ply", bytes);
    return read_ply(folder_ / "mesh.ply");
  }
};

TEST_F(PlyReader, rejects_every_truncation) {
  const std::string whole = written(MeshFormat::kPly, tetrahedron());
  for (size_t size = 0; size < whole.size(); ++size) {
    EXPECT_THROW(read(whole.substr(0, size)), InputError) << size;
  }
}

TEST_F(PlyReader, reads_or_rejects_every_damaged_file) {
  const std::string whole = written(MeshFormat::kPly, tetrahedron());
  rc::check([&] {
    std::string bytes = whole;
    const int flips = *rc::gen::inRange(1, 8);
    for (int i = 0; i < flips; ++i) {
      bytes[*rc::gen::inRange<size_t>(0, bytes.size())] = *rc::gen::arbitrary<char>();
    }
    try {
      const Mesh mesh = read(bytes);
      for (const auto& triangle : mesh.triangles) {
        for (const uint32_t vertex : triangle) RC_ASSERT(vertex < mesh.vertices.size());
      }
    } catch (const InputError&) {
      // a rejection with a message is allowed
    }
  });
}

/// One vertex of doubles, whose red is a float.
std::string ply_of(double x, float red) {
  std::string ply =
      "ply\nformat binary_little_endian 1.0\nelement vertex 1\nproperty double x\nproperty double "
      "y\nproperty double z\nproperty float red\nproperty uchar green\nproperty uchar "
      "blue\nend_header\n";
  for (const double value : {x, 0.0, 0.0}) {
    ply.append(reinterpret_cast<const char*>(&value), sizeof value);
  }
  ply.append(reinterpret_cast<const char*>(&red), sizeof red);
  return ply + std::string(2, '\7');
}

TEST_F(PlyReader, rejects_numbers_that_are_not_finite_in_a_mesh) {
  EXPECT_EQ(read(ply_of(0.5, 300)).colours.at(0), (Rgb8{255, 7, 7}));
  for (const double bad : {std::nan(""), 1e300, -1e300}) {
    EXPECT_THAT(test::message_of<InputError>([&] { read(ply_of(bad, 1)); }),
                HasSubstr("vertex 0 is not finite"));
  }
  EXPECT_THAT(test::message_of<InputError>([&] { read(ply_of(0.5, std::nanf(""))); }),
              HasSubstr("the colour of vertex 0 is not a number"));
}

TEST_F(PlyReader, rejects_an_index_without_its_vertex) {
  Mesh mesh = tetrahedron();
  mesh.triangles[1][2] = 4;
  EXPECT_THROW(read(written(MeshFormat::kPly, mesh)), InputError);
}

TEST_F(PlyReader, rejects_ascii_and_files_that_are_not_ply) {
  EXPECT_THROW(read("ply\nformat ascii 1.0\nelement vertex 0\nend_header\n"), InputError);
  EXPECT_THROW(read("solid cube"), InputError);
  EXPECT_THROW(read_ply(folder_ / "not there.ply"), InputError);
}

TEST_F(PlyReader, rejects_counts_that_no_file_could_hold) {
  const std::string head = "ply\nformat binary_little_endian 1.0\nelement vertex ";
  EXPECT_THROW(read(head + "99999999999\nproperty float x\nproperty float y\nproperty float z\n"
                           "end_header\n"),
               InputError);
  EXPECT_THROW(read(head + "99999999999\nend_header\n"), InputError);
}

TEST_F(PlyReader,
       turns_a_face_of_four_corners_into_two_triangles_and_passes_over_other_properties) {
  std::string bytes =
      "ply\nformat binary_little_endian 1.0\nelement vertex 4\nproperty float x\nproperty float y\n"
      "property double nx\nproperty float z\nelement face 1\nproperty list uint8 uint32 "
      "vertex_index\nend_header\n";
  for (int i = 0; i < 4; ++i) {
    const float xyz[] = {static_cast<float>(i), 1, 2};
    const double nx = 9;
    bytes.append(reinterpret_cast<const char*>(xyz), 8);
    bytes.append(reinterpret_cast<const char*>(&nx), 8);
    bytes.append(reinterpret_cast<const char*>(xyz + 2), 4);
  }
  const uint32_t corners[] = {0, 1, 2, 3};
  bytes += '\x04';
  bytes.append(reinterpret_cast<const char*>(corners), sizeof corners);
  const Mesh mesh = read(bytes);
  EXPECT_EQ(mesh.vertices[3], Eigen::Vector3f(3, 1, 2));
  EXPECT_THAT(mesh.triangles, testing::ElementsAre(std::array<uint32_t, 3>{0, 1, 2},
                                                   std::array<uint32_t, 3>{0, 2, 3}));
}

}  // namespace
}  // namespace v3d::ctl
