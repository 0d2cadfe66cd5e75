#include "v3d-sim/performer_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/core/error.h"
#include "sim/tiny_body.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"

namespace v3d::sim {
namespace {

using test::TemporaryFolder;
using testing::AllOf;
using testing::HasSubstr;

std::shared_ptr<const SkinnedModel> model_of(const TinyBody& body,
                                             const std::string& animation = "") {
  return parse_performer(body.file(), "/nowhere/tiny.glb", animation);
}

std::string rejection_of(const TinyBody& body, const std::string& animation = "") {
  return test::message_of<InputError>([&] { model_of(body, animation); });
}

TEST(PerformerFile, gives_closed_outward_oriented_parts_although_the_file_has_a_seam_and_a_hole) {
  const auto model = model_of(TinyBody());
  for (const double t : {0.0, 0.3, 0.95}) {
    const std::vector<Part> parts = model->parts_at(t);
    ASSERT_EQ(parts.size(), 2U);
    for (const Part& part : parts) {
      EXPECT_TRUE(is_manifold(part.mesh)) << "at " << t;
      EXPECT_GT(enclosed_volume(part.mesh), 0.005) << "at " << t;
      EXPECT_EQ(part.paint.size(), part.mesh.vertices.size());
    }
  }
}

TEST(PerformerFile, turns_surfaces_outward_that_a_file_has_inside_out) {
  TinyBody body;
  body.json()["nodes"][0]["scale"] = {-1, 1, 1};  // mirrors the body
  for (const Part& part : model_of(body)->parts_at(0)) EXPECT_GT(enclosed_volume(part.mesh), 0.005);
}

TEST(PerformerFile, stands_on_the_floor_at_the_origin_and_looks_along_x) {
  const auto model = model_of(TinyBody(), "Nod");
  EXPECT_NEAR(model->height_m(), 1.7, 1e-6);
  EXPECT_NEAR(model->extent().min().z(), 0, 1e-6);
  const auto joints = model->joint_positions(0);
  EXPECT_LT((joints[0] - Eigen::Vector3d(0, 0, 0.9)).norm(), 1e-6);
  EXPECT_LT((joints[1] - Eigen::Vector3d(0, 0, 1.5)).norm(), 1e-6);
  EXPECT_LT((joints[2] - Eigen::Vector3d(0, 0.1, 0.1)).norm(), 1e-6) << "the left is at +y";
  // The head nods forward.
  const auto top = [&](double t) { return model->parts_at(t)[1].mesh.vertices.back().x(); };
  EXPECT_GT(top(0.5), top(0) + 0.05F);
}

TEST(PerformerFile, walks_at_its_place) {
  const auto model = model_of(TinyBody(), "Walk");
  EXPECT_NEAR(model->period_s(), 1, 1e-9);
  double low = 1, high = 0;
  for (double t = 0; t < 3; t += 0.05) {
    const Eigen::Vector3d hips = model->joint_positions(t)[0];
    EXPECT_LT(hips.head<2>().norm(), 1e-6) << "at " << t;
    low = std::min(low, hips.z());
    high = std::max(high, hips.z());
  }
  EXPECT_NEAR(high - low, 0.05, 0.005) << "the vertical motion stays";
}

TEST(PerformerFile, repeats_without_a_jump_although_the_last_key_differs_from_the_first) {
  const auto model = model_of(TinyBody(), "Nod");
  const auto top = [&](double t) { return model->parts_at(t)[1].mesh.vertices.back(); };
  constexpr double kStep = 1e-3;
  for (double t = -0.5; t < 2.5; t += kStep) {
    ASSERT_LT((top(t + kStep) - top(t)).norm(), 2e-3F) << "at " << t;
  }
  EXPECT_LT((top(0.25) - top(7.25)).norm(), 1e-5F);
  EXPECT_LT((top(0.79) - top(0)).norm(), 0.15F);
  EXPECT_GT((top(0.79) - top(0)).norm(), 0.05F) << "changed before the last 0.2 s";
}

TEST(PerformerFile, moves_a_vertex_by_the_weighted_sum_of_its_joints) {
  const auto model = model_of(TinyBody(), "Nod");
  // The upper ring of the column follows hips and head with half of the weight each.
  const auto highest = [&](double t) {
    const std::vector<Part> parts = model->parts_at(t);
    float z = 0;
    for (const auto& v : parts[0].mesh.vertices) z = std::max(z, v.z());
    return double{z};
  };
  // The rear corners are 0.15 m behind the head joint, which turns by 30 degrees.
  EXPECT_NEAR(highest(0.5), 1.5 + 0.5 * 0.15 * std::sin(30 * M_PI / 180), 1e-4);
}

TEST(PerformerFile, has_the_materials_of_the_joints_that_move_its_parts) {
  const std::vector<Part> parts = model_of(TinyBody())->parts_at(0);
  EXPECT_EQ(parts[0].material, Material::kTrousers);
  EXPECT_EQ(parts[1].material, Material::kSkin);
}

TEST(PerformerFile, has_the_joints_of_the_skin_with_parents_and_main_names) {
  const std::vector<JointDefinition> joints = model_of(TinyBody())->joints();
  ASSERT_EQ(joints.size(), 3U);
  EXPECT_EQ(joints[0].name, "rig:Hips");
  EXPECT_EQ(joints[0].parent, -1);
  EXPECT_EQ(joints[0].main, "pelvis");
  EXPECT_EQ(joints[1].parent, 0);
  EXPECT_EQ(joints[1].main, "head");
  EXPECT_EQ(joints[2].main, "left_ankle");
}

TEST(PerformerFile, is_rejected_where_there_is_no_file_or_no_gltf) {
  const TemporaryFolder folder;
  EXPECT_THROW(load_performer(folder / "none.glb", ""), std::runtime_error);
  EXPECT_THROW(parse_performer("a text", "/nowhere/a.glb", ""), InputError);
  EXPECT_THROW(parse_performer("", "/nowhere/a.glb", ""), InputError);
  EXPECT_THROW(parse_performer("{}", "/nowhere/a.gltf", ""), InputError);
}

TEST(PerformerFile, is_rejected_without_a_skin_or_a_skinned_mesh) {
  TinyBody body;
  body.json()["nodes"][4].erase("skin");
  EXPECT_THAT(rejection_of(body), HasSubstr("no triangles of a skinned mesh"));
  body.json().erase("skins");
  EXPECT_THAT(rejection_of(body), HasSubstr("/nowhere/tiny.glb: has no skin"));
}

TEST(PerformerFile, is_rejected_without_the_animation_and_lists_those_that_exist) {
  TinyBody body;
  EXPECT_THAT(rejection_of(body, "Run"), HasSubstr("no animation 'Run'; it has Walk, Nod"));
  body.json().erase("animations");
  EXPECT_THAT(rejection_of(body), HasSubstr("has no animation"));
}

TEST(PerformerFile, is_rejected_where_numbers_are_not_finite) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  for (const char* attribute : {"POSITION", "WEIGHTS_0"}) {
    TinyBody body;
    body.set(body.primitive(0)["attributes"][attribute], 4, nan);
    EXPECT_THAT(rejection_of(body), AllOf(HasSubstr(attribute), HasSubstr("vertex 1")));
  }
  TinyBody skin;
  skin.set(skin.json()["skins"][0]["inverseBindMatrices"], 17, nan);
  EXPECT_THAT(rejection_of(skin), HasSubstr("inverseBindMatrices: joint 1"));
  for (const char* data : {"input", "output"}) {
    TinyBody body;
    body.set(body.json()["animations"][0]["samplers"][0][data], 1, nan);
    EXPECT_THAT(rejection_of(body), HasSubstr("animations[0].channels[0]"));
  }
  TinyBody nodes;
  nodes.json()["nodes"][0]["scale"] = {1e300, 1e300, 1e300};
  EXPECT_THAT(rejection_of(nodes), HasSubstr("not finite"));
}

TEST(PerformerFile, is_rejected_where_weights_sum_to_0_or_are_negative) {
  TinyBody zero, negative;
  const auto weights = zero.primitive(1)["attributes"]["WEIGHTS_0"];
  zero.set(weights, 4 * 2 + 1, 0.0F);
  EXPECT_THAT(rejection_of(zero), HasSubstr("meshes[0].primitives[1]: vertex 2 has weights"));
  negative.set(weights, 4 * 2 + 3, -0.5F);
  EXPECT_THAT(rejection_of(negative), HasSubstr("vertex 2 has weights"));
}

TEST(PerformerFile, normalises_weights_whose_sum_is_not_1) {
  TinyBody body;
  const auto weights = body.primitive(1)["attributes"]["WEIGHTS_0"];
  for (size_t v = 0; v < 10; ++v) body.set(weights, 4 * v + 1, 3.0F);
  EXPECT_NEAR(model_of(body)->height_m(), 1.7, 1e-6);
}

TEST(PerformerFile, is_rejected_where_an_index_is_out_of_range) {
  TinyBody joint;
  joint.set(joint.primitive(0)["attributes"]["JOINTS_0"], 4 * 3, uint8_t{3});
  EXPECT_THAT(rejection_of(joint), HasSubstr("vertex 3 names joint 3; the skin has 3 joints"));
  TinyBody corner;
  corner.set(corner.primitive(0)["indices"], 7, uint16_t{15});
  EXPECT_THAT(rejection_of(corner), HasSubstr("index 7 names vertex 15; there are 15 vertices"));
  TinyBody skin, node, mesh, sampler, accessor;
  skin.json()["skins"][0]["joints"][1] = 99;
  node.json()["animations"][0]["channels"][0]["target"]["node"] = 99;
  mesh.json()["nodes"][4]["mesh"] = 7;
  sampler.json()["animations"][0]["channels"][0]["sampler"] = 7;
  accessor.primitive(0)["indices"] = 77;
  for (const TinyBody& body : {skin, node, mesh, sampler}) {
    EXPECT_THAT(rejection_of(body), HasSubstr("is a damaged glTF"));
  }
  EXPECT_THAT(rejection_of(accessor), HasSubstr("accessor out of bounds"));
}

TEST(PerformerFile, is_rejected_where_an_accessor_exceeds_its_data) {
  for (const uint64_t count : {uint64_t{16}, uint64_t{1} << 31, uint64_t{1} << 62}) {
    TinyBody body;
    body.accessor(body.primitive(0)["attributes"]["POSITION"])["count"] = count;
    EXPECT_THAT(rejection_of(body), HasSubstr("/nowhere/tiny.glb")) << count;
  }
  TinyBody offset;
  offset.accessor(offset.primitive(0)["indices"])["byteOffset"] = uint64_t{1} << 62;
  EXPECT_NE(rejection_of(offset), "");
  TinyBody type;
  type.accessor(type.json()["skins"][0]["inverseBindMatrices"])["type"] = "VEC3";
  EXPECT_THAT(rejection_of(type), HasSubstr("is a damaged glTF"));
}

TEST(PerformerFile, is_rejected_where_counts_differ) {
  TinyBody rows;
  rows.accessor(rows.primitive(0)["attributes"]["WEIGHTS_0"])["count"] = 14;
  EXPECT_THAT(rejection_of(rows), HasSubstr("expected equal counts"));
  TinyBody keys;
  keys.accessor(keys.json()["animations"][0]["samplers"][0]["output"])["count"] = 2;
  EXPECT_THAT(rejection_of(keys), HasSubstr("3 times and 2 values"));
  TinyBody matrices;
  matrices.accessor(matrices.json()["skins"][0]["inverseBindMatrices"])["count"] = 2;
  EXPECT_THAT(rejection_of(matrices), HasSubstr("2 for 3 joints"));
}

TEST(PerformerFile, is_rejected_where_the_animation_is_not_read_here) {
  TinyBody spline, descending, zero, path;
  const auto sampler = [](TinyBody& body) -> nlohmann::json& {
    return body.json()["animations"][1]["samplers"][0];
  };
  sampler(spline)["interpolation"] = "CUBICSPLINE";
  EXPECT_THAT(rejection_of(spline, "Nod"), HasSubstr("expected LINEAR or STEP"));
  descending.set(sampler(descending)["input"], 2, 0.2F);
  EXPECT_THAT(rejection_of(descending, "Nod"), HasSubstr("key 2 is not after"));
  for (size_t k = 4; k < 8; ++k) zero.set(sampler(zero)["output"], k, 0.0F);
  EXPECT_THAT(rejection_of(zero, "Nod"), HasSubstr("key 1 has a quaternion of length 0"));
  path.json()["animations"][1]["channels"][0]["target"]["path"] = "colour";
  EXPECT_THAT(rejection_of(path, "Nod"), HasSubstr("expected translation, rotation or scale"));
}

TEST(PerformerFile, is_rejected_where_the_mesh_is_not_read_here) {
  TinyBody strip, influences, unweighted;
  strip.primitive(1)["mode"] = 5;
  EXPECT_THAT(rejection_of(strip), HasSubstr("primitives[1]: has mode 5; expected 4"));
  influences.primitive(1)["attributes"]["JOINTS_1"] =
      influences.primitive(1)["attributes"]["JOINTS_0"];
  EXPECT_THAT(rejection_of(influences), HasSubstr("JOINTS_1"));
  unweighted.primitive(1)["attributes"].erase("WEIGHTS_0");
  EXPECT_THAT(rejection_of(unweighted), HasSubstr("has no WEIGHTS_0"));
}

TEST(PerformerFile, is_rejected_where_its_height_is_not_that_of_a_person) {
  for (const double scale : {0.01, 100.0}) {
    TinyBody body;
    body.json()["nodes"][0]["scale"] = {scale, scale, scale};
    EXPECT_THAT(rejection_of(body, "Nod"), HasSubstr("scale it to metres")) << scale;
  }
}

TEST(PerformerFile, is_rejected_where_the_animation_leaves_the_studio) {
  TinyBody body;
  body.set(body.json()["animations"][0]["samplers"][0]["output"], 3, 3.0F);
  EXPECT_THAT(rejection_of(body, "Walk"), HasSubstr("m to a side"));
}

}  // namespace
}  // namespace v3d::sim
