#include "codec/camera_colours.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>

#include "codec/byte_stream.h"
#include "codec/frame_codec.h"
#include "codec/frame_reviser.h"
#include "codec/vertex_hierarchy.h"
#include "tests/codec/coded_scene.h"

extern "C" size_t seen_in_c(const uint8_t* bytes, size_t size, size_t camera);

namespace v3d::codec {
namespace {

constexpr size_t kPlenty = 10'000'000;

RC_GTEST_PROP(VertexTree, has_every_vertex_once_and_children_before_parents,
              (const std::vector<uint16_t>& numbers)) {
  std::vector<uint64_t> codes(numbers.begin(), numbers.end());
  for (uint64_t& code : codes) code %= 64;  // some are equal
  const VertexTree tree(codes);
  const auto vertices = static_cast<uint32_t>(codes.size());
  RC_ASSERT(tree.nodes().size() == (vertices == 0 ? 0 : vertices - 1));
  std::vector<int> uses(vertices + tree.nodes().size());
  for (size_t n = 0; n < tree.nodes().size(); ++n) {
    for (const uint32_t child : {tree.nodes()[n].low, tree.nodes()[n].high}) {
      RC_ASSERT(child < vertices + n);
      ++uses[child];
    }
  }
  for (size_t n = 0; n + 1 < uses.size(); ++n) RC_ASSERT(uses[n] == 1);
}

TEST(VertexTree, divides_by_the_highest_bit_that_differs) {
  const VertexTree tree(std::vector<uint64_t>{0b1000, 0b0001, 0b0011});
  ASSERT_EQ(tree.nodes().size(), 2U);
  EXPECT_EQ(tree.nodes()[0].low, 1U);
  EXPECT_EQ(tree.nodes()[0].high, 2U);
  EXPECT_EQ(tree.nodes()[1].low, 3U) << "the node of both";
  EXPECT_EQ(tree.nodes()[1].high, 0U);
}

TEST(VertexTree, interleaves_the_bits_of_a_position) {
  EXPECT_EQ(morton_code(1, 0, 0), 1U);
  EXPECT_EQ(morton_code(0, 2, 0), 16U);
  EXPECT_EQ(morton_code(0x1FFFFF, 0x1FFFFF, 0x1FFFFF), ~uint64_t{0} >> 1);
}

/// What two cameras along x, from either side, see of a frame: tinted, with fine detail.
std::vector<CameraView> views_of(const DecodedFrame& frame) {
  std::vector<CameraView> views(2);
  const auto [least, most] = std::ranges::minmax(
      frame.positions, {}, [](const VertexPosition& position) { return position[0]; });
  const float middle = (least[0] + most[0]) / 2;
  for (size_t c = 0; c < 2; ++c) {
    views[c].axis = {static_cast<int16_t>(c == 0 ? kAxisUnits : -kAxisUnits), 0, 0};
    for (size_t v = 0; v < frame.positions.size(); ++v) {
      const auto& [r, g, b] = frame.colours[v];
      const bool seen = (frame.positions[v][0] < middle) == (c == 0);
      const auto detail = static_cast<int>(hash(static_cast<uint32_t>(v), 3) % 9);
      const auto tinted = [&](int level, int by) {
        return static_cast<uint8_t>(std::clamp(level + by + detail, 0, 255));
      };
      views[c].vertices.push_back(seen ? std::array<uint8_t, 4>{tinted(r, c == 0 ? 12 : -20),
                                                                tinted(g, 0), tinted(b, -6), 255}
                                       : std::array<uint8_t, 4>{});
    }
  }
  return views;
}

struct Sequence {
  std::vector<std::vector<uint8_t>> frames;
  std::vector<std::vector<CameraView>> views;  ///< that were encoded
  std::vector<FrameReviser::CameraCost> costs;
};

Sequence with_views(const std::vector<std::vector<uint8_t>>& plain, size_t max_bytes) {
  Sequence sequence;
  FrameReviser reviser;
  for (const auto& frame : plain) {
    EXPECT_EQ(reviser.decode(frame), DecodeStatus::kOk);
    sequence.views.push_back(views_of(reviser.frame()));
    sequence.frames.push_back(reviser.with_cameras(sequence.views.back(), max_bytes));
    sequence.costs.push_back(reviser.camera_cost());
  }
  return sequence;
}

/// Greatest error of a colour; 1000 where a vertex is seen that should not be, or the reverse. A
/// vertex at the border of what faces the camera may be lost: at most one in 6.
int largest_error(const CameraView& wanted, const CameraView& decoded) {
  int largest = 0;
  size_t lost = 0;
  for (size_t v = 0; v < wanted.vertices.size(); ++v) {
    const auto &a = wanted.vertices[v], &b = decoded.vertices[v];
    if (b[3] == 0) {
      lost += a[3] != 0 ? 1 : 0;
      continue;
    }
    if (a[3] == 0) return 1000;
    for (size_t n = 0; n < 3; ++n) largest = std::max(largest, std::abs(a[n] - b[n]));
  }
  return 6 * lost > wanted.vertices.size() ? 1000 : largest;
}

TEST(CameraColours, decode_to_the_colours_of_each_camera_in_a_sequence) {
  const auto plain = moving_ball(4);
  const Sequence sequence = with_views(plain, kPlenty);
  FrameDecoder decoder, before;
  decoder.enable_cameras(true);
  for (size_t n = 0; n < plain.size(); ++n) {
    ASSERT_EQ(decoder.decode(sequence.frames[n]), DecodeStatus::kOk);
    ASSERT_EQ(before.decode(plain[n]), DecodeStatus::kOk);
    EXPECT_EQ(decoder.frame().positions, before.frame().positions);
    EXPECT_EQ(decoder.frame().colours, before.frame().colours);
    ASSERT_EQ(decoder.frame().cameras.size(), 2U);
    EXPECT_EQ(sequence.costs[n].step, 1);
    for (size_t c = 0; c < 2; ++c) {
      EXPECT_EQ(decoder.frame().cameras[c].axis, sequence.views[n][c].axis);
      EXPECT_LE(largest_error(sequence.views[n][c], decoder.frame().cameras[c]), 8);
    }
  }
}

TEST(CameraColours, keep_to_the_given_number_of_bytes_with_larger_errors) {
  const auto plain = moving_ball(3);
  const size_t finest = with_views(plain, kPlenty).costs[0].bytes;
  const size_t limit = finest / 4;
  const Sequence sequence = with_views(plain, limit);
  for (const auto& [bytes, step] : sequence.costs) {
    EXPECT_LE(bytes, limit);
    EXPECT_GT(bytes, limit / 2);
    EXPECT_GT(step, 1);
  }
}

TEST(CameraColours, of_a_frame_like_the_last_one_cost_few_bytes) {
  Scene scene(ball(15));
  scene.paint(1);
  FrameEncoder encoder({});
  std::vector<std::vector<uint8_t>> plain;
  for (const int64_t pulse : {0, 1}) plain.push_back(encoder.encode(scene.content(pulse)).value());
  const Sequence sequence = with_views(plain, kPlenty);
  EXPECT_LT(4 * sequence.costs[1].bytes, sequence.costs[0].bytes);
}

TEST(CameraColours, are_left_out_by_a_decoder_that_does_not_want_them) {
  const auto plain = moving_ball(2);
  const Sequence sequence = with_views(plain, kPlenty);
  FrameDecoder decoder;
  for (const auto& frame : sequence.frames) {
    ASSERT_EQ(decoder.decode(frame), DecodeStatus::kOk);
    EXPECT_TRUE(decoder.frame().cameras.empty());
  }
}

TEST(CameraColours, begin_at_the_next_key_frame_when_they_are_enabled) {
  const auto plain = moving_ball(6);
  const Sequence sequence = with_views(plain, kPlenty);
  FrameDecoder decoder;
  ASSERT_EQ(decoder.decode(sequence.frames[0]), DecodeStatus::kOk);
  decoder.enable_cameras(true);
  for (size_t n = 1; n < sequence.frames.size(); ++n) {
    ASSERT_EQ(decoder.decode(sequence.frames[n]), DecodeStatus::kOk);
    EXPECT_EQ(decoder.frame().cameras.empty(), n < 4) << n;
  }
}

TEST(CameraColours, can_be_removed) {
  const auto plain = moving_ball(3);
  const Sequence sequence = with_views(plain, kPlenty);
  FrameReviser reviser;
  for (size_t n = 0; n < plain.size(); ++n) {
    ASSERT_EQ(reviser.decode(sequence.frames[n]), DecodeStatus::kOk);
    EXPECT_EQ(reviser.with_cameras({}, 0), plain[n]);
  }
}

TEST(CameraColours, and_labels_leave_each_other_unchanged) {
  const auto plain = moving_ball(2);
  FrameReviser labeller, colourist, labeller_again;
  FrameDecoder decoder;
  decoder.enable_cameras(true);
  for (const auto& frame : plain) {
    ASSERT_EQ(labeller.decode(frame), DecodeStatus::kOk);
    const std::vector<uint8_t> labels(labeller.frame().positions.size(), 7);
    ASSERT_EQ(colourist.decode(labeller.labelled(labels)), DecodeStatus::kOk);
    const auto coloured = colourist.with_cameras(views_of(colourist.frame()), kPlenty);
    ASSERT_EQ(decoder.decode(coloured), DecodeStatus::kOk);
    EXPECT_EQ(decoder.frame().labels, labels);
    EXPECT_EQ(decoder.frame().cameras.size(), 2U);
    ASSERT_EQ(labeller_again.decode(coloured), DecodeStatus::kOk);
    labeller_again.labelled({});
  }
  FrameDecoder unlabelled;
  unlabelled.enable_cameras(true);
  ASSERT_EQ(labeller_again.decode(with_views(plain, kPlenty).frames[0]), DecodeStatus::kOk);
  ASSERT_EQ(unlabelled.decode(labeller_again.labelled({})), DecodeStatus::kOk);
  EXPECT_EQ(unlabelled.frame().cameras.size(), 2U) << "removing labels keeps colours of cameras";
}

TEST(CameraColours, of_vertices_that_do_not_face_the_camera_are_not_kept) {
  FrameReviser reviser;
  ASSERT_EQ(reviser.decode(moving_ball(1)[0]), DecodeStatus::kOk);
  std::vector<CameraView> views = views_of(reviser.frame());
  for (CameraView& view : views) {
    std::fill(view.vertices.begin(), view.vertices.end(), std::array<uint8_t, 4>{9, 9, 9, 255});
  }
  FrameDecoder decoder;
  decoder.enable_cameras(true);
  ASSERT_EQ(decoder.decode(reviser.with_cameras(views, kPlenty)), DecodeStatus::kOk);
  const auto seen = [&](size_t camera) {
    const auto& vertices = decoder.frame().cameras[camera].vertices;
    return std::count_if(vertices.begin(), vertices.end(), [](const auto& v) { return v[3] != 0; });
  };
  const auto vertices = static_cast<double>(decoder.frame().positions.size());
  EXPECT_NEAR(static_cast<double>(seen(0)) / vertices, 0.45, 0.06)
      << "half of a ball without its rim";
  EXPECT_NEAR(static_cast<double>(seen(1)) / vertices, 0.45, 0.06);
}

/// A frame with its checksum corrected.
std::vector<uint8_t> with_checksum(std::vector<uint8_t> frame) {
  const uint32_t sum = crc32(std::span(frame).subspan(16));
  std::memcpy(&frame[12], &sum, sizeof sum);
  return frame;
}

TEST(CameraColours, that_are_truncated_or_longer_are_malformed) {
  const std::vector<uint8_t> frame = with_views(moving_ball(1), kPlenty).frames[0];
  for (const int change : {-200, -100, -12, 12}) {
    std::vector<uint8_t> changed = frame;
    changed.resize(static_cast<size_t>(static_cast<int>(frame.size()) + change));
    FrameDecoder decoder;
    decoder.enable_cameras(true);
    EXPECT_EQ(decoder.decode(with_checksum(changed)), DecodeStatus::kMalformed) << change;
  }
}

TEST(CameraColours, of_unknown_flags_or_a_step_of_zero_are_malformed) {
  const Sequence sequence = with_views(moving_ball(1), kPlenty);
  const size_t section = sequence.frames[0].size() - sequence.costs[0].bytes;
  for (const size_t at : {size_t{0}, size_t{1}, size_t{3}}) {
    std::vector<uint8_t> changed = sequence.frames[0];
    changed[section + at] = at == 0 ? 2 : 0;
    FrameDecoder decoder;
    decoder.enable_cameras(true);
    EXPECT_EQ(decoder.decode(with_checksum(changed)), DecodeStatus::kMalformed) << at;
  }
}

TEST(CameraColours, of_a_key_frame_that_claim_a_previous_frame_are_malformed) {
  const Sequence sequence = with_views(moving_ball(1), kPlenty);
  std::vector<uint8_t> changed = sequence.frames[0];
  changed[changed.size() - sequence.costs[0].bytes] = 1;
  FrameDecoder decoder;
  decoder.enable_cameras(true);
  EXPECT_EQ(decoder.decode(with_checksum(changed)), DecodeStatus::kMalformed);
}

TEST(CameraColours, are_not_kept_of_a_mesh_without_colours) {
  const Scene scene(ball(10));
  FrameReviser reviser;
  ASSERT_EQ(reviser.decode(FrameEncoder({}).encode(scene.content(0)).value()), DecodeStatus::kOk);
  std::vector<CameraView> views(2);
  for (CameraView& view : views) view.vertices.resize(scene.mesh.vertices.size());
  reviser.with_cameras(views, kPlenty);
  EXPECT_EQ(reviser.camera_cost().bytes, 0U);
}

TEST(CameraColours, are_kept_of_a_mesh_without_a_volume) {
  Scene scene(ball(10));
  scene.paint(1);
  FrameContent content = scene.content(0);
  std::vector<VertexPosition> positions;
  std::vector<VertexTriangle> triangles{{0, 1, 2}, {0, 2, 3}, {0, 3, 1}, {1, 3, 2}};
  positions = {{0, 0, 0}, {0, 1, 0}, {1, 0, 0}, {0, 0, 1}};
  const std::vector<VertexColour> colours(4, VertexColour{50, 60, 70});
  content.volume = nullptr;
  content.metadata.origin = {0, 0, 0};
  content.metadata.step = 0.001;
  content.positions = positions;
  content.triangles = triangles;
  content.colours = colours;
  FrameReviser reviser;
  ASSERT_EQ(reviser.decode(FrameEncoder({}).encode(content).value()), DecodeStatus::kOk);
  std::vector<CameraView> views(2);
  views[0].axis = {0, 0, kAxisUnits};
  views[1].axis = {0, 0, -kAxisUnits};
  for (CameraView& view : views) view.vertices.assign(4, {90, 60, 70, 255});
  FrameDecoder decoder;
  decoder.enable_cameras(true);
  ASSERT_EQ(decoder.decode(reviser.with_cameras(views, kPlenty)), DecodeStatus::kOk);
  ASSERT_EQ(decoder.frame().cameras.size(), 2U);
  EXPECT_EQ(decoder.frame().cameras[0].vertices[0][3], 255);
  EXPECT_NEAR(decoder.frame().cameras[0].vertices[0][0], 90, 2);
  EXPECT_EQ(decoder.frame().cameras[0].vertices[3][3], 0) << "the tip faces upwards";
}

TEST(CDecoder, returns_the_views_of_cameras) {
  const Sequence sequence = with_views(moving_ball(1), kPlenty);
  FrameDecoder decoder;
  decoder.enable_cameras(true);
  ASSERT_EQ(decoder.decode(sequence.frames[0]), DecodeStatus::kOk);
  for (size_t camera = 0; camera < 2; ++camera) {
    const auto& vertices = decoder.frame().cameras[camera].vertices;
    const auto seen =
        std::count_if(vertices.begin(), vertices.end(), [](const auto& v) { return v[3] != 0; });
    EXPECT_EQ(seen_in_c(sequence.frames[0].data(), sequence.frames[0].size(), camera),
              static_cast<size_t>(seen));
  }
}

}  // namespace
}  // namespace v3d::codec
