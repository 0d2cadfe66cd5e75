#include "recon/pipeline/compact_frame.h"

#include <gtest/gtest.h>

namespace v3d::recon {
namespace {

/// A triangle on its lattice, a shade lighter with every pulse.
struct Triangle {
  const std::vector<codec::VertexPosition> positions{{0, 0, 0}, {0.5F, 0, 0}, {0, 0.25F, 1}};
  const std::vector<codec::VertexTriangle> triangles{{0, 1, 2}};
  const std::vector<Rgb8> colours{{10, 200, 30}, {40, 50, 60}, {255, 0, 255}};

  std::vector<uint8_t> encoded() const {
    const std::vector<codec::VertexColour> coded = vertex_colours(colours);
    codec::FrameContent content;
    content.metadata = {.pulse = 7,
                        .exposure_ns = 1'700'000'000'000'000'000,
                        .cameras = {"cam01", "cam02"},
                        .missing = 2,
                        .quality = 0.5F,
                        .origin = {0, 0, 0},
                        .step = 0.25};
    content.positions = positions;
    content.triangles = triangles;
    content.colours = coded;
    return codec::FrameEncoder({.colour_steps = {1, 1, 1}}).encode(content).value();
  }
};

TEST(CompactFrame, decodes_to_the_encoded_content) {
  const Triangle triangle;
  const auto frame = decode_compact(triangle.encoded());
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->pulse, 7);
  EXPECT_EQ(to_ns(frame->exposure), 1'700'000'000'000'000'000);
  EXPECT_EQ(frame->cameras, (std::vector<std::string>{"cam01", "cam02"}));
  EXPECT_EQ(frame->missing, 2);
  EXPECT_EQ(frame->quality, 0.5F);
  EXPECT_EQ(frame->lattice, (VertexLattice{{0, 0, 0}, 0.25}));
  EXPECT_EQ(vertex_positions(frame->mesh.vertices), triangle.positions);
  EXPECT_EQ(frame->mesh.triangles, triangle.triangles);
  EXPECT_EQ(frame->mesh.colours, triangle.colours);
}

TEST(CompactFrame, has_the_triangles_of_a_performer_whose_vertices_are_all_his) {
  Mesh mesh;
  mesh.vertices.resize(5);
  mesh.triangles = {{0, 1, 2}, {1, 3, 2}, {2, 3, 4}};
  const std::vector<uint8_t> performers = {1, 1, 1, 2, 2};
  EXPECT_EQ(triangles_of_performer(mesh, performers, 1),
            (std::vector<std::array<uint32_t, 3>>{{0, 1, 2}}));
  EXPECT_TRUE(triangles_of_performer(mesh, performers, 2).empty());
  EXPECT_TRUE(triangles_of_performer(mesh, {}, 1).empty());
}

TEST(CompactFrame, is_empty_for_other_bytes) {
  std::vector<uint8_t> bytes = Triangle().encoded();
  bytes.back() ^= 1;
  EXPECT_FALSE(decode_compact(bytes));
  EXPECT_FALSE(decode_compact({}));
}

TEST(VertexLattice, rounds_to_the_nearest_point_on_either_side_of_its_origin) {
  const VertexLattice lattice{{1, 1, 1}, 0.5};
  EXPECT_EQ(rounded_to(lattice, {1.7F, 0.3F, 1}), Eigen::Vector3f(1.5F, 0.5F, 1));
  const Eigen::Vector3f once = rounded_to({{0.1, 0.2, 0.3}, 0.001}, {-3.33333F, 7.77777F, 1});
  EXPECT_EQ(rounded_to({{0.1, 0.2, 0.3}, 0.001}, once), once);
}

}  // namespace
}  // namespace v3d::recon
