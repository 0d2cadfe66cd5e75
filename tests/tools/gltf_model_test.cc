// Tests of glTF 2.0 models from untrusted sources: accepted models, and messages for rejected ones.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <limits>
#include <nlohmann/json.hpp>
#include <numbers>

#include "base/core/error.h"
#include "base/image/image_files.h"
#include "base/io/file.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"
#include "v3dctl/scene/model.h"

namespace v3d::ctl {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kInfinity = std::numeric_limits<float>::infinity();

/// The content of triangle.bin: a triangle with texture coordinates.
struct Triangle {
  std::array<float, 9> positions{0, 0, 0, 1, 0, 0, 0, 1, 0};
  std::array<float, 6> uvs{0, 0, 1, 0, 0, 1};
};

json triangle_gltf() {
  return json::parse(R"({
    "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
    "meshes": [{"primitives": [
      {"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "material": 0}]}],
    "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
    "textures": [{"source": 0}], "images": [{"uri": "red.png"}],
    "accessors": [{"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 3},
                  {"bufferView": 1, "componentType": 5126, "type": "VEC2", "count": 3}],
    "bufferViews": [{"buffer": 0, "byteLength": 36},
                    {"buffer": 0, "byteOffset": 36, "byteLength": 24}],
    "buffers": [{"uri": "triangle.bin", "byteLength": 60}]})");
}

class GltfModel : public testing::Test {
 protected:
  GltfModel() {
    fs::create_directory(folder_ / "models");
    put(Triangle());
    Image red({4, 4}, PixelFormat::kRGB8);
    for (size_t i = 0; i < red.bytes.size(); i += 3) red.bytes[i] = 255;
    write_png(folder_ / "models/red.png", red.view());
  }

  void put(const Triangle& triangle) {
    std::string bytes(60, '\0');
    std::memcpy(bytes.data(), triangle.positions.data(), 36);
    std::memcpy(bytes.data() + 36, triangle.uvs.data(), 24);
    replace_file(folder_ / "models/triangle.bin", bytes);
  }

  ModelSurface load(const json& gltf) {
    replace_file(path_, gltf.dump());
    return load_model(path_);
  }
  /// The message of the rejection of this file.
  std::string rejection(const json& gltf) {
    const std::string line = test::message_of<InputError>([&] { load(gltf); });
    EXPECT_THAT(line, AllOf(HasSubstr(path_.string() + ": "), Not(HasSubstr("\n"))));
    return line;
  }
  std::string rejection_of(const Triangle& triangle) {
    put(triangle);
    return rejection(triangle_gltf());
  }

  const test::TemporaryFolder folder_;
  const fs::path path_ = folder_ / "models/model.gltf";
};

TEST_F(GltfModel, has_the_colours_of_its_texture) {
  const ModelSurface surface = load(triangle_gltf());
  ASSERT_FALSE(surface.albedo.empty());
  EXPECT_EQ(surface.albedo.front(), Eigen::Vector3f::UnitX());
}

/// A gltf whose three vertices have the same texture coordinates.
class GltfTexture : public GltfModel {
 protected:
  /// A picture whose left half is red and whose right half is blue.
  GltfTexture() {
    Image halves({2, 1}, PixelFormat::kRGB8);
    halves.bytes = {255, 0, 0, 0, 0, 255};
    write_png(folder_ / "models/red.png", halves.view());
  }

  /// The colour of the surface at these texture coordinates.
  Eigen::Vector3f colour_at(float u, float v, const json& gltf) {
    put({.uvs = {u, v, u, v, u, v}});
    const ModelSurface surface = load(gltf);
    for (const Eigen::Vector3f& albedo : surface.albedo) EXPECT_EQ(albedo, surface.albedo[0]);
    return surface.albedo.at(0);
  }

  static json& texture_of(json& gltf) {
    return gltf["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"];
  }

  const Eigen::Vector3f red_ = Eigen::Vector3f::UnitX(), blue_ = Eigen::Vector3f::UnitZ();
};

TEST_F(GltfTexture, is_scaled_rotated_and_moved_by_its_transform) {
  json gltf = triangle_gltf();
  EXPECT_EQ(colour_at(0.25F, 0.75F, gltf), red_);
  json& transform = texture_of(gltf)["extensions"]["KHR_texture_transform"];
  transform = {{"scale", {3, 1}}};
  EXPECT_EQ(colour_at(0.25F, 0.75F, gltf), blue_);
  transform = {{"offset", {0.5, 0}}};
  EXPECT_EQ(colour_at(0.25F, 0.75F, gltf), blue_);
  transform = {{"rotation", std::numbers::pi / 2}};
  EXPECT_LT((colour_at(0.25F, 0.75F, gltf) - blue_).norm(), 1e-3F);
  gltf["extensionsRequired"] = {"KHR_texture_transform"};
  EXPECT_LT((colour_at(0.25F, 0.75F, gltf) - blue_).norm(), 1e-3F);
  transform = {{"scale", {1e300, 1}}};
  EXPECT_THAT(rejection(gltf), HasSubstr("meshes[0].primitives[0]: KHR_texture_transform makes"));
}

TEST_F(GltfTexture, has_the_coordinates_that_its_material_names) {
  json gltf = triangle_gltf();
  json& attributes = gltf["meshes"][0]["primitives"][0]["attributes"];
  attributes["TEXCOORD_1"] = attributes["TEXCOORD_0"];
  attributes.erase("TEXCOORD_0");
  texture_of(gltf)["texCoord"] = 1;
  EXPECT_EQ(colour_at(0.75F, 0.5F, gltf), blue_);
  texture_of(gltf)["texCoord"] = 0;
  texture_of(gltf)["extensions"]["KHR_texture_transform"] = {{"texCoord", 1}};
  EXPECT_EQ(colour_at(0.75F, 0.5F, gltf), blue_);
}

TEST_F(GltfTexture, is_repeated_clamped_or_mirrored_as_its_sampler_says) {
  json gltf = triangle_gltf();
  EXPECT_EQ(colour_at(1.25F, 0.5F, gltf), red_);
  gltf["textures"][0]["sampler"] = 0;
  gltf["samplers"] = json::parse(R"([{"wrapS": 33071}])");
  EXPECT_EQ(colour_at(1.25F, 0.5F, gltf), blue_);
  EXPECT_EQ(colour_at(-0.25F, 0.5F, gltf), red_);
  gltf["samplers"] = json::parse(R"([{"wrapS": 33648}])");
  EXPECT_EQ(colour_at(1.25F, 0.5F, gltf), blue_);
  EXPECT_EQ(colour_at(1.75F, 0.5F, gltf), red_);
}

/// A model whose vertices follow two joints.
class GltfSkin : public GltfModel {
 protected:
  GltfSkin() {
    std::string bytes("\0\1\0\0\0\1\0\0\0\1\0\0", 12);  // numbers of joints: 0 1 0 0
    const auto add = [&](float value) {
      bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
    };
    for (const float share : {0.0F, 0.0F, 0.5F}) {  // of the second joint
      for (const float weight : {1 - share, share, 0.0F, 0.0F}) add(weight);
    }
    for (int joint = 0; joint < 2; ++joint) {
      const Eigen::Affine3f inverse_bind(Eigen::Translation3f(0, 0, -3));
      for (int n = 0; n < 16; ++n) add(inverse_bind.matrix().data()[n]);
    }
    replace_file(folder_ / "models/skin.bin", bytes);
  }

  static json skinned() {
    json gltf = triangle_gltf();
    gltf["buffers"][1] = {{"uri", "skin.bin"}, {"byteLength", 188}};
    gltf["bufferViews"][2] = {{"buffer", 1}, {"byteLength", 12}};
    gltf["bufferViews"][3] = {{"buffer", 1}, {"byteOffset", 12}, {"byteLength", 48}};
    gltf["bufferViews"][4] = {{"buffer", 1}, {"byteOffset", 60}, {"byteLength", 128}};
    gltf["accessors"][2] = {
        {"bufferView", 2}, {"componentType", 5121}, {"type", "VEC4"}, {"count", 3}};
    gltf["accessors"][3] = {
        {"bufferView", 3}, {"componentType", 5126}, {"type", "VEC4"}, {"count", 3}};
    gltf["accessors"][4] = {
        {"bufferView", 4}, {"componentType", 5126}, {"type", "MAT4"}, {"count", 2}};
    json& attributes = gltf["meshes"][0]["primitives"][0]["attributes"];
    attributes["JOINTS_0"] = 2;
    attributes["WEIGHTS_0"] = 3;
    gltf["skins"] = json::parse(R"([{"joints": [2, 3], "inverseBindMatrices": 4}])");
    gltf["nodes"] = json::parse(R"([{"mesh": 0, "skin": 0, "scale": [100, 100, 100]},
      {"translation": [1, 0, 0], "children": [2, 3]},
      {"translation": [0, 2, 0]}, {"translation": [0, 2, 4]}])");
    gltf["scenes"][0]["nodes"] = {0, 1};
    return gltf;
  }
};

TEST_F(GltfSkin, places_the_vertices_by_its_joints_and_not_by_the_node) {
  const ModelSurface surface = load(skinned());
  // (0, 0, 0) by the first joint to (1, 2, -3); (0, 1, 0) by both to (1, 3, -1): then y up to z up.
  EXPECT_LT((surface.mesh.vertices.front() - Eigen::Vector3f(1, 3, 2)).norm(), 1e-5F);
  EXPECT_LT((surface.mesh.vertices.back() - Eigen::Vector3f(1, 1, 3)).norm(), 1e-5F);
  for (const Eigen::Vector3f& normal : surface.normals) EXPECT_NEAR(normal.norm(), 1, 1e-5F);
}

TEST_F(GltfSkin, is_rejected_when_it_names_a_joint_that_it_does_not_have_or_lacks_weights) {
  json gltf = skinned();
  gltf["skins"][0]["joints"] = {2};
  EXPECT_THAT(rejection(gltf), HasSubstr("vertex 2 names joint 1; the skin has 1, from 0"));
  gltf["skins"][0]["joints"] = {2, 3, 1};
  EXPECT_THAT(rejection(gltf), HasSubstr("skins[0].inverseBindMatrices: 2 for 3 joints"));
  gltf["skins"][0]["joints"] = {2, 9};
  EXPECT_THAT(rejection(gltf), HasSubstr("damaged"));
  gltf = skinned();
  gltf["meshes"][0]["primitives"][0]["attributes"].erase("WEIGHTS_0");
  EXPECT_THAT(rejection(gltf), HasSubstr("meshes[0].primitives[0]: has no WEIGHTS_0"));
  gltf = skinned();
  gltf["nodes"][0]["skin"] = 1;
  EXPECT_THAT(rejection(gltf), HasSubstr("damaged"));
}

TEST_F(GltfModel, has_the_triangles_of_strips_and_fans_on_the_right_side) {
  for (const int mode : {5, 6}) {
    json gltf = triangle_gltf();
    gltf["meshes"][0]["primitives"][0]["mode"] = mode;
    const ModelSurface surface = load(gltf);
    EXPECT_FALSE(surface.mesh.triangles.empty());
    EXPECT_EQ(surface.normals.front(), Eigen::Vector3f(0, -1, 0)) << "+z of the file";
  }
  json gltf = triangle_gltf();
  gltf["meshes"][0]["primitives"][0]["mode"] = 7;
  EXPECT_THAT(rejection(gltf), HasSubstr("meshes[0].primitives[0]: mode 7 does not exist"));
}

TEST_F(GltfModel, is_rejected_when_a_node_has_two_parents) {
  // Each of 40 nodes has the next one as a child twice: 2^40 paths from the root in 1.6 kB.
  json gltf = triangle_gltf();
  for (int n = 0; n < 40; ++n) gltf["nodes"][n] = {{"children", {n + 1, n + 1}}};
  gltf["nodes"][40] = json::object();
  EXPECT_THAT(rejection(gltf), HasSubstr("nodes[0].children: names node 1, which is a child of "
                                         "nodes[0] already; expected one parent at most"));
  gltf["nodes"] =
      json::parse(R"([{"children": [1, 2]}, {"children": [3]}, {"children": [3]}, {}])");
  EXPECT_THAT(rejection(gltf), HasSubstr("nodes[2].children: names node 3"));
}

TEST_F(GltfModel, is_rejected_when_a_node_is_its_own_ancestor_or_lies_too_deep) {
  json gltf = triangle_gltf();
  gltf["nodes"] = json::parse(R"([{"children": [1]}, {"children": [0]}])");
  EXPECT_THAT(rejection(gltf), HasSubstr("nodes"));
  gltf["nodes"] = json::parse(R"([{"mesh": 0}, {"children": [2]}, {"children": [1]}])");
  EXPECT_THAT(rejection(gltf), HasSubstr("nodes[1]: is its own ancestor"));
  gltf["nodes"] = json::array();
  for (int n = 0; n < 100; ++n) gltf["nodes"].push_back({{"children", {n + 1}}});
  gltf["nodes"].push_back({{"mesh", 0}});
  EXPECT_THAT(rejection(gltf), HasSubstr("expected at most 64"));
}

TEST_F(GltfModel, is_rejected_when_a_scene_names_a_child_or_a_node_twice) {
  json gltf = triangle_gltf();
  gltf["nodes"] = json::parse(R"([{"children": [1]}, {"mesh": 0}])");
  gltf["scenes"][0]["nodes"] = {0, 1};
  EXPECT_THAT(rejection(gltf), HasSubstr("scenes[0].nodes: names node 1"));
  gltf["scenes"][0]["nodes"] = {0, 0};
  EXPECT_THAT(rejection(gltf), HasSubstr("scenes[0].nodes: names node 0 twice"));
  gltf["scenes"][0]["nodes"] = {7};
  EXPECT_THAT(rejection(gltf), HasSubstr("scenes[0].nodes: names node 7, which does not exist"));
}

TEST_F(GltfModel, reads_no_file_outside_of_its_folder) {
  fs::copy_file(folder_ / "models/triangle.bin", folder_ / "outside.bin");
  fs::copy_file(folder_ / "models/red.png", folder_ / "outside.png");
  fs::create_symlink("../outside.bin", folder_ / "models/link.bin");
  fs::create_directory_symlink("..", folder_ / "models/up");
  const std::string absolute = folder_ / "outside.bin";
  for (const std::string& uri :
       {absolute, std::string("../outside.bin"), "file://" + absolute,
        std::string("%2e%2e/outside.bin"), std::string("%2E./outside.bin"),
        std::string("..%2foutside.bin"), std::string("http://a/b.bin"),
        std::string("x/../../outside.bin"), std::string("..\\outside.bin"),
        std::string("triangle.bin%00"), std::string("%zz.bin"), std::string("%7")}) {
    json gltf = triangle_gltf();
    gltf["buffers"][0]["uri"] = uri;
    EXPECT_THAT(rejection(gltf),
                HasSubstr("buffers[0].uri: expected the path of a file in the model's folder"))
        << uri;
  }
  for (const char* uri : {"link.bin", "up/outside.bin"}) {
    json gltf = triangle_gltf();
    gltf["buffers"][0]["uri"] = uri;
    EXPECT_THAT(rejection(gltf), HasSubstr("is a link out of the model's folder")) << uri;
  }
  for (const char* uri : {"../outside.png", "%2e%2e/outside.png", "up/outside.png"}) {
    json gltf = triangle_gltf();
    gltf["images"][0]["uri"] = uri;
    EXPECT_THAT(rejection(gltf), HasSubstr("images[0].uri: ")) << uri;
  }
}

TEST_F(GltfModel, reads_no_file_of_the_working_directory) {
  const fs::path before = fs::current_path();
  fs::create_directory(folder_ / "work");
  fs::rename(folder_ / "models/triangle.bin", folder_ / "work/triangle.bin");
  fs::current_path(folder_ / "work");
  const std::string line = rejection(triangle_gltf());
  fs::current_path(before);
  EXPECT_THAT(line, AllOf(HasSubstr("buffers[0].uri: "), HasSubstr("No such file")));
}

TEST_F(GltfModel, reads_files_whose_names_are_percent_encoded_and_through_a_linked_folder) {
  fs::create_directory(folder_ / "models/a b");
  fs::rename(folder_ / "models/triangle.bin", folder_ / "models/a b/jk.bin");
  json gltf = triangle_gltf();
  gltf["buffers"][0]["uri"] = "a%20b/%6A%6b.bin";
  EXPECT_FALSE(load(gltf).mesh.triangles.empty());
  fs::create_directory_symlink("models", folder_ / "elsewhere");
  EXPECT_FALSE(load_model(folder_ / "elsewhere/model.gltf").mesh.triangles.empty());
}

TEST_F(GltfModel, is_rejected_when_positions_or_texture_coordinates_are_not_finite) {
  for (const float bad : {kNan, kInfinity, -kInfinity, 3e38F}) {
    Triangle triangle;
    triangle.positions[4] = bad;
    EXPECT_THAT(rejection_of(triangle), HasSubstr("POSITION: vertex 1"));
    triangle = {};
    triangle.uvs[5] = bad;
    EXPECT_THAT(rejection_of(triangle), HasSubstr("TEXCOORD_0: vertex 2"));
  }
}

TEST_F(GltfModel, is_rejected_when_vertices_are_beyond_1000_km) {
  json gltf = triangle_gltf();
  gltf["nodes"][0]["scale"] = {1e30, 1e30, 1e30};
  EXPECT_THAT(rejection(gltf), HasSubstr("expected vertices within 1000 km"));
  gltf["nodes"][0] = {{"mesh", 0}, {"translation", {0, 0, 1e300}}};
  EXPECT_THAT(rejection(gltf), HasSubstr("expected vertices within 1000 km"));
}

TEST_F(GltfModel,
       has_finite_light_and_colours_where_a_scale_is_zero_and_the_texture_repeats_far_out) {
  json gltf = triangle_gltf();
  gltf["nodes"][0]["scale"] = {1, 0, 1};
  gltf["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"] = {1e300, 1, 1, 1};
  Triangle triangle;
  triangle.uvs = {0, 0, 1e8F, 0, 0, -1e8F};
  put(triangle);
  const ModelSurface surface = load(gltf);
  for (const auto* list : {&surface.mesh.vertices, &surface.normals, &surface.albedo}) {
    for (const Eigen::Vector3f& v : *list) ASSERT_TRUE(v.allFinite()) << v.transpose();
  }
}

TEST_F(GltfModel, is_rejected_when_a_view_ends_beyond_its_buffer) {
  json gltf = triangle_gltf();
  gltf["images"][0] = {{"bufferView", 2}, {"mimeType", "image/png"}};
  gltf["bufferViews"][2] = {{"buffer", 0}, {"byteOffset", 1'000'000'000}, {"byteLength", 1000}};
  EXPECT_THAT(rejection(gltf), HasSubstr("bufferViews[2]: ends beyond its buffer"));
}

TEST_F(GltfModel, is_rejected_when_a_picture_is_damaged) {
  replace_file(folder_ / "models/red.png", "no picture");
  EXPECT_THAT(rejection(triangle_gltf()), HasSubstr("images[0]: not a valid PNG or JPEG picture"));
}

TEST_F(GltfModel, is_rejected_when_its_json_is_deeper_than_64_levels) {
  const std::string deep(200'000, '[');
  replace_file(path_, R"({"asset": {"version": "2.0"}, "extras": )" + deep);
  EXPECT_THAT(test::message_of<InputError>([&] { load_model(path_); }),
              HasSubstr("expected at most 64 levels of JSON"));
}

TEST_F(GltfModel, is_rejected_when_its_json_has_over_4_million_values) {
  std::string many = R"({"asset": {"version": "2.0"}, "extras": [0)";
  for (int n = 0; n < 4'000'000; ++n) many += ",0";
  replace_file(path_, many + "]}");
  EXPECT_THAT(test::message_of<InputError>([&] { load_model(path_); }),
              HasSubstr("expected at most 4 million values of JSON"));
}

TEST_F(GltfModel, is_rejected_when_it_is_empty_truncated_or_no_regular_file) {
  for (const char* name : {"empty.glb", "empty.gltf"}) {
    replace_file(folder_ / name, "");
    EXPECT_THAT(test::message_of<InputError>([&] { load_model(folder_ / name); }),
                HasSubstr(std::string(name) + ": is no glTF 2.0"));
  }
  EXPECT_THAT(test::message_of<InputError>([&] { load_model(folder_.path()); }),
              HasSubstr("is not a regular file"));
  replace_file(folder_ / "short.glb", std::string("glTF\2\0\0\0", 8));
  EXPECT_THAT(test::message_of<InputError>([&] { load_model(folder_ / "short.glb"); }),
              HasSubstr("is no glTF 2.0"));
}

TEST_F(GltfModel, is_read_or_rejected_in_one_line_for_every_input_of_the_fuzzer) {
  int inputs = 0;
  for (const auto& entry : fs::directory_iterator(V3D_GLTF_CORPUS)) {
    ++inputs;
    try {
      const ModelSurface surface = load_model(entry.path());
      EXPECT_FALSE(surface.mesh.triangles.empty()) << entry.path();
    } catch (const InputError& error) {
      EXPECT_THAT(error.what(), HasSubstr(entry.path().string())) << entry.path();
    }
  }
  EXPECT_GE(inputs, 4);
}

}  // namespace
}  // namespace v3d::ctl
