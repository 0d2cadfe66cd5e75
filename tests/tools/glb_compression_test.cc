// Tests of compressed GLB files, decoded by the public Draco and meshoptimizer libraries.
#include <dlfcn.h>
#include <draco/compression/decode.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <meshoptimizer.h>

#include <algorithm>
#include <map>
#include <set>

#include "base/core/error.h"
#include "base/io/file.h"
#include "recon/shapes.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"
#include "tools/glb.h"
#include "v3dctl/export/mesh_export.h"
#include "v3dctl/scene/model.h"

namespace v3d::ctl {
namespace {

using nlohmann::json;
using test::Glb;
using testing::HasSubstr;

const VertexLattice kLattice{{-1.5, -1.5, 0}, 0.0005};

/// A ball whose vertices lie on kLattice, coloured with all values that a channel can have.
Mesh ball_on_lattice() {
  Mesh ball = recon::shapes::sphere({0.2F, -0.1F, 1}, 0.3F, 24);
  for (size_t v = 0; v < ball.vertices.size(); ++v) {
    ball.vertices[v] = rounded_to(kLattice, ball.vertices[v]);
    ball.colours.push_back(
        {static_cast<uint8_t>(v), static_cast<uint8_t>(7 * v), static_cast<uint8_t>(255 - v)});
  }
  return ball;
}

std::vector<ExportedCamera> two_cameras(size_t vertices) {
  std::vector<ExportedCamera> cameras(2);
  cameras[0].colours.camera = "cam01";
  cameras[1].colours.camera = "left-eye";
  for (size_t v = 0; v < vertices; ++v) {
    const auto n = static_cast<uint8_t>(v);
    cameras[0].colours.vertices.push_back({n, static_cast<uint8_t>(n + 1), 3, 255});
    cameras[1].colours.vertices.push_back({9, n, static_cast<uint8_t>(3 * n), 128});
  }
  return cameras;
}

/// The decoded file: attributes by vertex, in metres, z up.
struct Opened {
  std::vector<Eigen::Vector3d> positions;
  std::vector<Rgb8> colours;
  std::vector<std::array<uint8_t, 4>> cam01, left_eye;
  std::vector<std::array<uint32_t, 3>> triangles;
};

Rgb8 srgb_of(const std::array<double, 3>& linear) {
  return {test::srgb_of(linear[0]), test::srgb_of(linear[1]), test::srgb_of(linear[2])};
}

template <class T, size_t kWidth>
std::vector<std::array<T, kWidth>> values_of(const draco::Mesh& mesh, int id) {
  const draco::PointAttribute* attribute = mesh.GetAttributeByUniqueId(id);
  std::vector<std::array<T, kWidth>> values(mesh.num_points());
  for (uint32_t v = 0; v < mesh.num_points(); ++v) {
    attribute->GetValue(attribute->mapped_index(draco::PointIndex(v)), values[v].data());
  }
  return values;
}

Opened open_draco(const Glb& glb) {
  const json& extension = glb.primitive()["extensions"]["KHR_draco_mesh_compression"];
  const json& view = glb.scene["bufferViews"][extension["bufferView"].get<size_t>()];
  draco::DecoderBuffer buffer;
  buffer.Init(glb.buffer.data() + view["byteOffset"].get<size_t>(),
              view["byteLength"].get<size_t>());
  draco::Decoder decoder;
  const auto mesh = std::move(decoder.DecodeMeshFromBuffer(&buffer)).value();
  EXPECT_EQ(mesh->num_points(), glb.accessor("POSITION")["count"].get<size_t>());
  EXPECT_EQ(3 * mesh->num_faces(), glb.indices()["count"].get<size_t>());
  const auto id = [&](const char* semantic) {
    return extension["attributes"][semantic].get<int>();
  };
  Opened opened;
  for (const auto& p : values_of<float, 3>(*mesh, id("POSITION"))) {
    opened.positions.emplace_back(p[0], p[1], p[2]);
  }
  if (extension["attributes"].contains("COLOR_0")) {
    for (const auto& c : values_of<float, 3>(*mesh, id("COLOR_0"))) {
      opened.colours.push_back(srgb_of({c[0], c[1], c[2]}));
    }
  }
  if (extension["attributes"].contains("_CAM01_COLOR")) {
    opened.cam01 = values_of<uint8_t, 4>(*mesh, id("_CAM01_COLOR"));
    opened.left_eye = values_of<uint8_t, 4>(*mesh, id("_LEFT_EYE_COLOR"));
  }
  for (uint32_t f = 0; f < mesh->num_faces(); ++f) {
    const auto& face = mesh->face(draco::FaceIndex(f));
    opened.triangles.push_back({face[0].value(), face[1].value(), face[2].value()});
  }
  return opened;
}

/// Decodes the views of the fallback buffer, as the extension specifies.
template <class T, size_t kWidth>
std::vector<std::array<T, kWidth>> meshopt_values(const Glb& glb, const json& accessor) {
  const json& view = glb.scene["bufferViews"][accessor["bufferView"].get<size_t>()];
  const json& extension = view["extensions"]["EXT_meshopt_compression"];
  const size_t count = extension["count"], stride = extension["byteStride"];
  const auto* from =
      reinterpret_cast<const uint8_t*>(glb.buffer.data()) + extension["byteOffset"].get<size_t>();
  std::vector<uint8_t> bytes(count * stride);
  EXPECT_EQ(bytes.size(), view["byteLength"].get<size_t>());
  const size_t size = extension["byteLength"];
  EXPECT_EQ(extension["mode"] == "TRIANGLES"
                ? meshopt_decodeIndexBuffer(bytes.data(), count, stride, from, size)
                : meshopt_decodeVertexBuffer(bytes.data(), count, stride, from, size),
            0);
  std::vector<std::array<T, kWidth>> values(accessor["count"].get<size_t>());
  for (size_t v = 0; v < values.size(); ++v) {
    std::memcpy(values[v].data(), bytes.data() + v * stride, sizeof(T) * kWidth);
  }
  return values;
}

Opened open_meshopt(const Glb& glb) {
  const json& node = glb.scene["nodes"][0];
  const auto vector = [&](const char* key) {
    return Eigen::Vector3d(node[key][0], node[key][1], node[key][2]);
  };
  Opened opened;
  for (const auto& p : meshopt_values<uint16_t, 3>(glb, glb.accessor("POSITION"))) {
    const Eigen::Vector3d position =
        vector("scale").cwiseProduct(Eigen::Vector3d(p[0], p[1], p[2]));
    const Eigen::Vector3d turned(position.x(), position.z(), -position.y());  // the node's rotation
    const Eigen::Vector3d y_up = vector("translation") + turned;
    opened.positions.emplace_back(y_up.x(), -y_up.z(), y_up.y());
  }
  const json& attributes = glb.primitive()["attributes"];
  if (attributes.contains("COLOR_0")) {
    for (const auto& c : meshopt_values<uint16_t, 3>(glb, glb.accessor("COLOR_0"))) {
      opened.colours.push_back(srgb_of({c[0] / 65535.0, c[1] / 65535.0, c[2] / 65535.0}));
    }
  }
  if (attributes.contains("_CAM01_COLOR")) {
    opened.cam01 = meshopt_values<uint8_t, 4>(glb, glb.accessor("_CAM01_COLOR"));
    opened.left_eye = meshopt_values<uint8_t, 4>(glb, glb.accessor("_LEFT_EYE_COLOR"));
  }
  const auto corners = meshopt_values<uint32_t, 1>(glb, glb.indices());
  for (size_t n = 0; n + 3 <= corners.size(); n += 3) {
    opened.triangles.push_back({corners[n][0], corners[n + 1][0], corners[n + 2][0]});
  }
  return opened;
}

/// For every vertex of `mesh` the index of the nearest vertex of `opened`, and the largest
/// distance.
std::pair<std::vector<uint32_t>, double> nearest(const Opened& opened, const Mesh& mesh) {
  std::vector<uint32_t> found;
  double farthest = 0;
  for (const Eigen::Vector3f& vertex : mesh.vertices) {
    size_t best = 0;
    double least = 1e9;
    for (size_t v = 0; v < opened.positions.size(); ++v) {
      const double distance = (opened.positions[v] - vertex.cast<double>()).norm();
      if (distance < least) best = v, least = distance;
    }
    found.push_back(static_cast<uint32_t>(best));
    farthest = std::max(farthest, least);
  }
  return {found, farthest};
}

std::array<uint32_t, 3> from_the_lowest(std::array<uint32_t, 3> t) {
  std::rotate(t.begin(), std::min_element(t.begin(), t.end()), t.end());
  return t;
}

struct Variant {
  const char* name;
  Compression compression;
  Opened (*open)(const Glb&);
};

class GlbCompression : public testing::TestWithParam<Variant> {
 protected:
  Opened opened(const Mesh& mesh, const MeshFileOptions& options) {
    write_mesh(folder_ / "mesh.glb", MeshFormat::kGlb, mesh, options);
    return GetParam().open(test::parse_glb(read_file(folder_ / "mesh.glb")));
  }
  test::TemporaryFolder folder_;
};

TEST_P(GlbCompression, keeps_every_triangle_position_and_colour) {
  const Mesh ball = ball_on_lattice();
  const auto cameras = two_cameras(ball.vertices.size());
  const Opened ball_again = opened(
      ball, {.compression = GetParam().compression, .lattice = kLattice, .cameras = cameras});
  ASSERT_EQ(ball_again.positions.size(), ball.vertices.size());
  const auto [place, farthest] = nearest(ball_again, ball);
  EXPECT_LT(farthest, 1e-6);
  for (size_t v = 0; v < ball.vertices.size(); ++v) {
    EXPECT_EQ(ball_again.colours[place[v]], ball.colours[v]) << v;
    EXPECT_EQ(ball_again.cam01[place[v]], cameras[0].colours.vertices[v]) << v;
    EXPECT_EQ(ball_again.left_eye[place[v]], cameras[1].colours.vertices[v]) << v;
  }
  std::multiset<std::array<uint32_t, 3>> wanted, found;
  for (const auto& [a, b, c] : ball.triangles) {
    wanted.insert(from_the_lowest({place[a], place[b], place[c]}));
  }
  for (const auto& triangle : ball_again.triangles) found.insert(from_the_lowest(triangle));
  EXPECT_EQ(found, wanted);
}

TEST_P(GlbCompression, is_much_smaller_than_the_plain_file) {
  const Mesh ball = ball_on_lattice();
  opened(ball, {.compression = GetParam().compression, .lattice = kLattice});
  const auto compressed = std::filesystem::file_size(folder_ / "mesh.glb");
  write_mesh(folder_ / "plain.glb", MeshFormat::kGlb, ball);
  EXPECT_LT(2 * compressed, std::filesystem::file_size(folder_ / "plain.glb"));
}

TEST_P(GlbCompression, accepts_a_mesh_without_colours_and_without_a_lattice) {
  const Mesh ball = recon::shapes::sphere({0.2F, -0.1F, 1}, 0.3F, 10);
  const Opened again = opened(ball, {.compression = GetParam().compression});
  EXPECT_TRUE(again.colours.empty());
  EXPECT_EQ(again.triangles.size(), ball.triangles.size());
  EXPECT_LT(nearest(again, ball).second, 0.6 / 65535);
}

TEST_P(GlbCompression, coarsens_a_lattice_of_too_many_steps_by_the_smallest_factor) {
  const Mesh ball = recon::shapes::sphere({0.2F, -0.1F, 1}, 0.3F, 10);
  const Opened again =
      opened(ball, {.compression = GetParam().compression, .lattice = {{-1.5, -1.5, 0}, 1e-6}});
  // 0.6 m are 600,000 steps; the coarse step is 16 of them.
  const double farthest = nearest(again, ball).second;
  EXPECT_GT(farthest, 1e-6);
  EXPECT_LT(farthest, 16e-6);
}

TEST_P(GlbCompression, writes_an_empty_scene_for_an_empty_mesh) {
  write_mesh(folder_ / "mesh.glb", MeshFormat::kGlb, {}, {.compression = GetParam().compression});
  const Glb glb = test::parse_glb(read_file(folder_ / "mesh.glb"));
  EXPECT_FALSE(glb.scene.contains("meshes"));
  EXPECT_FALSE(glb.scene.contains("extensionsRequired"));
}

TEST_P(GlbCompression, is_rejected_as_a_model_of_a_scene_with_the_reason) {
  opened(ball_on_lattice(), {.compression = GetParam().compression, .lattice = kLattice});
  EXPECT_THAT(test::message_of<InputError>([&] { load_model(folder_ / "mesh.glb"); }),
              testing::AllOf(HasSubstr("mesh.glb: requires "), HasSubstr("_compression")));
}

INSTANTIATE_TEST_SUITE_P(By, GlbCompression,
                         testing::Values(Variant{"Draco", Compression::kDraco, open_draco},
                                         Variant{"Meshopt", Compression::kMeshopt, open_meshopt}),
                         [](const auto& variant) { return std::string(variant.param.name); });

TEST(GlbLibraries, use_the_tinygltf_library_and_not_the_copy_within_draco) {
  // tinygltf::FileExists(std::string const&, void*)
  void* function =
      dlsym(RTLD_DEFAULT,
            "_ZN8tinygltf10FileExistsERKNSt7__cxx1112basic_stringIcSt11char_traitsIcESaIcEEEPv");
  ASSERT_NE(function, nullptr);
  Dl_info info{};
  ASSERT_NE(dladdr(function, &info), 0);
  EXPECT_THAT(info.dli_fname, HasSubstr("libtinygltf"));
}

}  // namespace
}  // namespace v3d::ctl
