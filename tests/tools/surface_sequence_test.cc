#include "v3dctl/export/surface_sequence.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/core/error.h"
#include "gltf/gltf_file.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"
#include "tools/glb.h"

namespace v3d::ctl {
namespace {

using nlohmann::json;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;

Mesh tetrahedron(float height) {
  Mesh mesh;
  mesh.vertices = {{0, 0, 0}, {1, 0, 0}, {0, 2, 0}, {0.25F, 0.5F, height}};
  mesh.triangles = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};
  mesh.colours = {{255, 0, 0}, {0, 255, 0}, {0, 0, 255}, {188, 1, 0}};
  return mesh;
}

/// The same triangles but for the first.
Mesh other_triangles(float height) {
  Mesh mesh = tetrahedron(height);
  mesh.triangles[0] = {2, 1, 0};
  return mesh;
}

class GlbSequence : public testing::Test {
 protected:
  void add(int64_t pulse, const Mesh& mesh) { sequence_->add(pulse, mesh); }
  /// The whole file: what it must be at any place, checked.
  GltfFile finished() {
    bytes_ = sequence_->finish();
    return GltfFile(bytes_, "sequence.glb");
  }
  const json scene() const { return test::parse_glb(bytes_).scene; }

  /// Keys and values of the animated property of a node.
  struct Track {
    std::vector<float> times, values;
    std::string interpolation;
  };
  static Track track(GltfFile& file, const std::string& node, const std::string& path,
                     size_t width) {
    for (const auto& channel : file.model().animations.at(0).channels) {
      if (channel.target_path != path) continue;
      if (file.model().nodes[static_cast<size_t>(channel.target_node)].name != node) continue;
      const auto& sampler =
          file.model().animations[0].samplers[static_cast<size_t>(channel.sampler)];
      Track track;
      track.times = file.numbers(sampler.input, 1, "times");
      track.values = file.numbers(sampler.output, width, "values");
      track.interpolation = sampler.interpolation;
      return track;
    }
    ADD_FAILURE() << "no animation of " << node << "." << path;
    return {};
  }

  std::string bytes_;
  std::unique_ptr<SurfaceSequence> sequence_ = make_glb_sequence({"kendo-07", 12.5});
};

TEST_F(GlbSequence, shows_one_surface_at_a_time_until_the_next_pulse) {
  add(12, tetrahedron(1));
  add(13, other_triangles(2));
  add(16, tetrahedron(3));
  GltfFile file = finished();
  const Track first = track(file, "000012", "scale", 3);
  EXPECT_EQ(first.interpolation, "STEP");
  EXPECT_THAT(first.times, ElementsAre(0, 0.08F));
  EXPECT_THAT(first.values, ElementsAre(1, 1, 1, 0, 0, 0));
  const Track second = track(file, "000013", "scale", 3);
  EXPECT_THAT(second.times, ElementsAre(0, 0.08F, 0.32F));
  EXPECT_THAT(second.values, ElementsAre(0, 0, 0, 1, 1, 1, 0, 0, 0));
  const Track last = track(file, "000016", "scale", 3);
  EXPECT_THAT(last.times, ElementsAre(0, 0.32F, 0.4F)) << "it lasts for one period";
  EXPECT_THAT(last.values, ElementsAre(0, 0, 0, 1, 1, 1, 1, 1, 1));
}

TEST_F(GlbSequence, has_names_the_rate_and_without_animation_the_first_surface) {
  add(3, tetrahedron(1));
  add(5, other_triangles(2));
  finished();
  const json gltf = scene();
  const json& root = gltf["nodes"][gltf["scenes"][0]["nodes"][0].get<size_t>()];
  EXPECT_EQ(root["name"], "kendo-07");
  EXPECT_EQ(root["extras"]["take"], "kendo-07");
  EXPECT_EQ(root["extras"]["rate_hz"], 12.5);
  EXPECT_EQ(root["extras"]["pulses"], json({3, 5}));
  EXPECT_FALSE(root["extras"].contains("first_timecode"));
  EXPECT_EQ(gltf["nodes"][root["children"][0].get<size_t>()].value("scale", json()), json());
  EXPECT_EQ(gltf["nodes"][root["children"][1].get<size_t>()]["scale"], json({0, 0, 0}));
  EXPECT_EQ(gltf["nodes"][root["children"][1].get<size_t>()]["name"], "000005");
}

TEST_F(GlbSequence, has_the_timecode_of_its_pulses_where_it_is_known) {
  sequence_ =
      make_glb_sequence({"kendo-07", 25, [](int64_t pulse) {
                           return take::PulseTimecode{.rate = sound::TimecodeRate::k2997Drop,
                                                      .frames = static_cast<double>(pulse)};
                         }});
  add(3, tetrahedron(1));
  add(1800, other_triangles(2));
  finished();
  const json gltf = scene();
  const json& root = gltf["nodes"][gltf["scenes"][0]["nodes"][0].get<size_t>()];
  EXPECT_EQ(root["extras"]["first_timecode"], "00:00:00;03");
  EXPECT_EQ(root["extras"]["timecode_rate"], "29.97df");
  const json& second = gltf["nodes"][root["children"][1].get<size_t>()];
  EXPECT_EQ(second["extras"]["pulse"], 1800);
  EXPECT_EQ(second["extras"]["timecode"], "00:01:00;02");
}

TEST_F(GlbSequence, morphs_surfaces_with_equal_triangles_linearly_from_pulse_to_pulse) {
  add(0, tetrahedron(1));
  add(1, tetrahedron(1.5F));
  add(2, tetrahedron(3));
  GltfFile file = finished();
  ASSERT_EQ(file.model().meshes.size(), 1U);
  const auto& primitive = file.model().meshes[0].primitives[0];
  ASSERT_EQ(primitive.targets.size(), 2U);
  const auto displacement = file.numbers(primitive.targets[1].at("POSITION"), 3, "target");
  EXPECT_THAT(displacement, ElementsAre(0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 2));
  const Track weights = track(file, "000000", "weights", 1);
  EXPECT_EQ(weights.interpolation, "LINEAR");
  EXPECT_THAT(weights.times, ElementsAre(0, 0.08F, 0.16F));
  EXPECT_THAT(weights.values, ElementsAre(0, 0, 1, 0, 0, 1));
  EXPECT_EQ(scene()["meshes"][0]["extras"]["targetNames"], json({"000001", "000002"}));
  EXPECT_EQ(scene()["meshes"][0]["weights"], json({0, 0}));
}

TEST_F(GlbSequence, has_the_mean_colour_of_a_morphing_surface_in_linear_light) {
  Mesh dark = tetrahedron(2);
  dark.colours[0] = {0, 0, 0};
  add(0, tetrahedron(1));
  add(1, dark);
  GltfFile file = finished();
  const auto& primitive = file.model().meshes[0].primitives[0];
  const auto colours = file.numbers(primitive.attributes.at("COLOR_0"), 4, "colours");
  EXPECT_NEAR(colours[0], 0.5, 1e-4);
  EXPECT_EQ(colours[3], 1);
  EXPECT_NEAR(colours[12], 0.5029, 2e-3) << "sRGB 188 is half the light";
}

TEST_F(GlbSequence, begins_another_mesh_after_256_pulses) {
  for (int pulse = 0; pulse < 300; ++pulse) add(pulse, tetrahedron(1.0F + 0.01F * pulse));
  const GltfFile file = finished();
  ASSERT_EQ(file.model().meshes.size(), 2U);
  EXPECT_EQ(file.model().meshes[0].primitives[0].targets.size(), 255U);
  EXPECT_EQ(file.model().meshes[1].name, "000256");
}

TEST_F(GlbSequence, shows_nothing_at_a_pulse_with_an_empty_surface) {
  add(0, tetrahedron(1));
  add(1, {});
  add(2, tetrahedron(1));
  GltfFile file = finished();
  EXPECT_EQ(file.model().meshes.size(), 2U);
  EXPECT_THAT(track(file, "000000", "scale", 3).times, ElementsAre(0, 0.08F));
  EXPECT_THAT(track(file, "000002", "scale", 3).times, ElementsAre(0, 0.16F, 0.24F));
}

TEST_F(GlbSequence, shows_its_first_surface_without_animation_after_empty_ones) {
  add(0, {});
  add(1, tetrahedron(1));
  add(2, other_triangles(1));
  GltfFile file = finished();
  const json nodes = scene()["nodes"];
  ASSERT_EQ(nodes.size(), 3U) << "the root and two surfaces";
  EXPECT_EQ(nodes[1]["name"], "000001");
  EXPECT_FALSE(nodes[1].contains("scale"));
  EXPECT_EQ(nodes[2]["scale"], json({0, 0, 0}));
  EXPECT_THAT(track(file, "000001", "scale", 3).values, ElementsAre(0, 0, 0, 1, 1, 1, 0, 0, 0));
}

TEST_F(GlbSequence, of_empty_surfaces_alone_is_a_valid_file) {
  add(0, {});
  EXPECT_TRUE(finished().model().meshes.empty());
}

TEST_F(GlbSequence, ends_at_the_pulse_that_exceeds_the_format) {
  const auto begin = [&] {
    sequence_ = make_glb_sequence({.take = "kendo-07", .rate_hz = 25, .max_glb_bytes = 200});
  };
  const auto rejection = [&](int64_t pulse) {
    return test::message_of<InputError>([&] { add(pulse, tetrahedron(7)); });
  };
  begin();
  add(0, tetrahedron(1));  // a mesh of 128 bytes, written with the next pulse
  add(1, other_triangles(1));
  EXPECT_THAT(rejection(2),
              HasSubstr("the surfaces up to pulse 1 exceed; expected fewer --frames"));
  begin();
  for (int pulse = 0; pulse < 5; ++pulse) add(pulse, tetrahedron(1.0F + 0.1F * pulse));
  EXPECT_THAT(rejection(5), HasSubstr("up to pulse 5 exceed")) << "five morph targets of 48 bytes";
}

std::string usda(const std::vector<std::pair<int64_t, Mesh>>& surfaces) {
  const auto sequence = make_usda_sequence({"a \"take\"", 12.5});
  for (const auto& [pulse, mesh] : surfaces) sequence->add(pulse, mesh);
  return sequence->finish();
}

TEST(UsdaSequence, has_metres_z_up_and_one_time_code_for_each_pulse) {
  const std::string text = usda({{12, tetrahedron(1)}, {15, tetrahedron(2)}});
  EXPECT_THAT(text, testing::StartsWith("#usda 1.0\n"));
  for (const char* line :
       {"metersPerUnit = 1\n", "upAxis = \"Z\"\n", "timeCodesPerSecond = 12.5\n",
        "startTimeCode = 12\n", "endTimeCode = 15\n", "doc = \"take a \\\"take\\\"\"\n"}) {
    EXPECT_THAT(text, HasSubstr(line));
  }
}

TEST(UsdaSequence, has_samples_of_points_and_colours_and_of_triangles_only_where_they_change) {
  const std::string text =
      usda({{0, tetrahedron(1)}, {1, tetrahedron(2)}, {2, other_triangles(2)}});
  EXPECT_THAT(text, HasSubstr("1: [(0, 0, 0), (1, 0, 0), (0, 2, 0), (0.25, 0.5, 2)],\n"));
  EXPECT_THAT(text, HasSubstr("1: [(0, 0, 0), (1, 2, 2)],\n"));
  EXPECT_THAT(text, HasSubstr("(0.5029, 0.0003035, 0)"));
  EXPECT_THAT(text, HasSubstr("faceVertexIndices.timeSamples = {\n"
                              "            0: [0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3],\n"
                              "            2: [2, 1, 0, 0, 1, 3, 0, 3, 2, 1, 2, 3],\n"
                              "        }\n"));
}

TEST(UsdaSequence, ends_at_the_pulse_that_exceeds_its_limit) {
  const uint64_t one = usda({{0, tetrahedron(1)}}).size();
  const auto sequence =
      make_usda_sequence({.take = "kendo-07", .rate_hz = 25, .max_usda_bytes = 2 * one});
  sequence->add(0, tetrahedron(1));
  EXPECT_THAT(test::message_of<InputError>([&] {
                for (int64_t pulse = 1; pulse < 100; ++pulse) sequence->add(pulse, tetrahedron(2));
              }),
              HasSubstr("more than the memory permits ("));
}

TEST(UsdaSequence, without_colours_has_none) {
  Mesh mesh = tetrahedron(1);
  mesh.colours.clear();
  EXPECT_THAT(usda({{0, mesh}}), Not(HasSubstr("displayColor")));
}

}  // namespace
}  // namespace v3d::ctl
