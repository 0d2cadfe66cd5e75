#include "codec/frame_codec.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "codec/byte_stream.h"
#include "codec/frame_header.h"
#include "codec/frame_reviser.h"
#include "codec/occupancy.h"
#include "tests/codec/coded_scene.h"

extern "C" size_t vertices_in_c(const uint8_t* bytes, size_t size);

namespace v3d::codec {
namespace {

bool same_surface(const DecodedFrame& a, const Mesh& b) {
  if (a.positions.size() != b.vertices.size() || a.triangles != b.triangles) return false;
  for (size_t v = 0; v < a.positions.size(); ++v) {
    const auto& p = a.positions[v];
    if (p[0] != b.vertices[v].x() || p[1] != b.vertices[v].y() || p[2] != b.vertices[v].z()) {
      return false;
    }
  }
  return true;
}

bool same(const DecodedFrame& a, const DecodedFrame& b) {
  return a.positions == b.positions && a.triangles == b.triangles && a.colours == b.colours;
}

double psnr_db(const std::vector<VertexColour>& a, const std::vector<VertexColour>& b) {
  double sum = 0;
  for (size_t v = 0; v < a.size(); ++v) {
    for (int c = 0; c < 3; ++c) sum += (a[v][c] - b[v][c]) * (a[v][c] - b[v][c]);
  }
  return 10 * std::log10(255 * 255 * 3 * static_cast<double>(a.size()) / sum);
}

RC_GTEST_PROP(FrameCodec, decodes_the_marching_cubes_surface_of_any_volume, ()) {
  const auto edge = rc::gen::inRange(1, 30);
  const Scene scene(dust(recon::small_grid(*edge, *edge, *edge), *rc::gen::arbitrary<uint32_t>(),
                         *rc::gen::inRange<uint32_t>(0, 1001)));
  const auto bytes = FrameEncoder({}).encode(scene.content(0));
  RC_ASSERT(bytes.has_value());
  FrameDecoder decoder;
  RC_ASSERT(decoder.decode(*bytes) == DecodeStatus::kOk);
  RC_ASSERT(same_surface(decoder.frame(), scene.mesh));
}

TEST(FrameCodec, aborts_in_every_build_when_a_precondition_is_violated) {
  EXPECT_DEATH(FrameEncoder({.key_every = 0}),
               "frame_encoder.cc:[0-9]+: check failed: options.key_every >= 1");
  EXPECT_DEATH(FrameEncoder({.colour_steps = {6, 0, 12}}), "check failed: step >= 1");
  EXPECT_DEATH(FrameEncoder({.colour_steps = {6, 15, 65}}), "check failed: step >= 1");
  const std::array<uint8_t, 3> bytes{};
  EXPECT_DEATH(ByteReader(bytes).number<uint32_t>(), "byte_stream.h:[0-9]+: check failed");
}

TEST(FrameCodec, needs_less_than_a_bit_per_vertex_for_a_ball_and_no_displacement) {
  const Scene scene(ball(22));
  FrameEncoder encoder({});
  ASSERT_TRUE(encoder.encode(scene.content(0)));
  EXPECT_LT(8 * encoder.bytes().shape, scene.mesh.vertices.size());
  EXPECT_EQ(encoder.bytes().displacements, 0U);
}

TEST(FrameCodec, keeps_colours_to_38_db_in_key_frames_and_other_frames) {
  FrameEncoder encoder({});
  FrameDecoder decoder;
  for (int n = 0; n < 3; ++n) {
    Scene scene(ball(20, 25 + n));
    scene.paint(n);
    ASSERT_EQ(decoder.decode(encoder.encode(scene.content(n)).value()), DecodeStatus::kOk);
    EXPECT_GE(psnr_db(decoder.frame().colours, scene.colours), 38);
    EXPECT_TRUE(same(decoder.frame(), encoder.decoded()));
  }
}

TEST(FrameCodec, keeps_every_bit_of_colours_with_steps_of_1) {
  Scene scene(ball(15));
  scene.paint(1);
  FrameEncoder encoder({.colour_steps = {1, 1, 1}});
  FrameDecoder decoder;
  ASSERT_EQ(decoder.decode(encoder.encode(scene.content(0)).value()), DecodeStatus::kOk);
  EXPECT_EQ(decoder.frame().colours, scene.colours);
}

TEST(FrameCodec, keeps_moved_vertices_within_half_a_step_and_reports_the_step) {
  Scene scene(ball(15));
  scene.move(0.02);
  size_t coarser = 0;
  for (const double step_m : {0.001, 0.0005, 0.0001}) {
    FrameEncoder encoder({.displacement_step_m = step_m});
    FrameDecoder decoder;
    ASSERT_EQ(decoder.decode(encoder.encode(scene.content(0)).value()), DecodeStatus::kOk);
    const DecodedFrame& frame = decoder.frame();
    EXPECT_DOUBLE_EQ(frame.metadata.step, step_m);
    for (size_t v = 0; v < scene.moved.size(); ++v) {
      for (int axis = 0; axis < 3; ++axis) {
        ASSERT_NEAR(frame.positions[v][axis], scene.moved[v][axis], 0.5 * step_m + 1e-6);
      }
    }
    EXPECT_EQ(frame.triangles, scene.mesh.triangles);
    EXPECT_TRUE(same(frame, encoder.decoded()));
    EXPECT_GT(encoder.bytes().displacements, coarser);
    coarser = encoder.bytes().displacements;
  }
}

TEST(FrameCodec, needs_less_for_unchanged_colours_than_a_tenth_of_a_key_frame) {
  Scene scene(ball(20));
  scene.paint(1);
  FrameEncoder encoder({});
  encoder.encode(scene.content(0));
  const size_t key = encoder.bytes().colours;
  encoder.encode(scene.content(1));
  EXPECT_LT(10 * encoder.bytes().colours, key);
}

TEST(FrameCodec, continues_at_the_next_key_frame_after_a_loss) {
  const auto frames = moving_ball(10);
  FrameDecoder whole, lossy;
  for (size_t n = 0; n < frames.size(); ++n) {
    ASSERT_EQ(whole.decode(frames[n]), DecodeStatus::kOk);
    if (n == 1) continue;  // lost
    const bool hidden = n == 2 || n == 3;
    EXPECT_EQ(lossy.decode(frames[n]), hidden ? DecodeStatus::kNeedsReference : DecodeStatus::kOk);
    EXPECT_EQ(same(lossy.frame(), whole.frame()), !hidden) << n;
    EXPECT_EQ(whole.frame().key_pulse, 8 + static_cast<int>(n) / 4 * 4);
  }
}

TEST(FrameCodec, decodes_only_complete_frames_when_one_in_twenty_is_lost) {
  FrameDecoder whole, lossy;
  int lost = 0, shown = 0;
  bool complete = true;  // all frames since the key frame have arrived
  for (const auto& frame : moving_ball(80)) {
    ASSERT_EQ(whole.decode(frame), DecodeStatus::kOk);
    const int64_t pulse = whole.frame().metadata.pulse;
    const bool arrives = hash(static_cast<uint32_t>(pulse), 5) % 20 != 0;
    complete = (complete || whole.frame().key_pulse == pulse) && arrives;
    lost += arrives ? 0 : 1;
    if (!arrives) continue;
    ASSERT_EQ(lossy.decode(frame) == DecodeStatus::kOk, complete) << pulse;
    if (!complete) continue;
    ASSERT_TRUE(same(lossy.frame(), whole.frame())) << pulse;
    ++shown;
  }
  EXPECT_GE(lost, 2);
  EXPECT_GE(shown, 80 - 4 * lost);
}

TEST(FrameCodec, gives_the_same_bytes_from_the_next_key_frame_after_missing_pulses) {
  auto whole = moving_ball(6);
  const auto gap = moving_ball(6, 9);
  whole.erase(whole.begin() + 1);
  EXPECT_NE(gap[1], whole[1]);
  EXPECT_TRUE(std::equal(gap.begin() + 3, gap.end(), whole.begin() + 3, whole.end()));
}

TEST(FrameCodec, starts_with_a_key_frame_after_a_restart_and_when_pulses_do_not_increase) {
  Scene scene(ball(8));
  scene.paint(3);
  FrameEncoder encoder({});
  encoder.encode(scene.content(5));
  encoder.encode(scene.content(6));
  EXPECT_EQ(encoder.decoded().key_pulse, 5);
  encoder.encode(scene.content(6));
  EXPECT_EQ(encoder.decoded().key_pulse, 6);
  encoder.restart();
  encoder.encode(scene.content(7));
  EXPECT_EQ(encoder.decoded().key_pulse, 7);
}

/// A mesh without a volume; vertices are numbered in the order in which the triangles first use
/// them.
struct AnyMesh {
  std::vector<VertexPosition> positions{
      {0, 0, 0}, {0.5F, 0, 0}, {0, 0.25F, 0}, {1, 1, 1}, {2, 2, 2}};
  std::vector<VertexTriangle> triangles{{0, 1, 2}, {2, 1, 3}, {0, 0, 3}};
  std::vector<VertexColour> colours{{1, 2, 3}, {4, 5, 6}, {255, 0, 255}, {0, 0, 0}, {9, 9, 9}};

  FrameContent content() const {
    FrameContent c;
    c.metadata.step = 0.25;
    c.positions = positions;
    c.triangles = triangles;
    c.colours = colours;
    return c;
  }
};

TEST(FrameCodec, keeps_a_mesh_without_a_volume) {
  const AnyMesh mesh;
  FrameEncoder encoder({.colour_steps = {1, 1, 1}});
  FrameDecoder decoder;
  ASSERT_EQ(decoder.decode(encoder.encode(mesh.content()).value()), DecodeStatus::kOk);
  EXPECT_EQ(decoder.frame().positions, mesh.positions);
  EXPECT_EQ(decoder.frame().triangles, mesh.triangles);
  EXPECT_EQ(decoder.frame().colours, mesh.colours);
}

TEST(FrameCodec, rejects_invalid_content) {
  FrameEncoder encoder({});
  AnyMesh jumping;
  jumping.triangles[0] = {1, 0, 2};
  EXPECT_FALSE(encoder.encode(jumping.content()));
  AnyMesh outside;
  outside.positions[4][0] = 65536 * 0.25F;
  EXPECT_FALSE(encoder.encode(outside.content()));
  AnyMesh nowhere;
  nowhere.positions[0][2] = NAN;
  EXPECT_FALSE(encoder.encode(nowhere.content()));
  Scene far(ball(5));
  far.paint(0);
  far.moved.assign(far.mesh.vertices.size(), {1000, 0, 0});
  EXPECT_FALSE(encoder.encode(far.content(0)));
  FrameContent unsorted = AnyMesh().content();
  unsorted.metadata.cameras = {"b", "a"};
  EXPECT_FALSE(encoder.encode(unsorted));
  FrameContent percent = AnyMesh().content();
  percent.metadata.quality = 95;
  EXPECT_FALSE(encoder.encode(percent));
}

TEST(FrameCodec, rejects_a_truncated_or_changed_frame) {
  const auto frame = moving_ball(1)[0];
  FrameDecoder decoder;
  for (size_t size = 0; size < frame.size(); size += size < 140 ? 1 : 37) {
    ASSERT_EQ(decoder.decode(std::span(frame).first(size)), DecodeStatus::kMalformed) << size;
  }
  for (size_t at = 0; at < frame.size(); at += at < 140 ? 1 : 37) {
    auto changed = frame;
    changed[at] ^= 0x40;
    ASSERT_EQ(decoder.decode(changed), DecodeStatus::kMalformed) << at;
  }
}

RC_GTEST_PROP(FrameCodec, keeps_a_label_of_each_vertex, ()) {
  Scene scene(dust(recon::small_grid(12, 12, 12), *rc::gen::arbitrary<uint32_t>(), 300));
  const auto seed = *rc::gen::arbitrary<uint32_t>();
  const auto kinds = *rc::gen::inRange<uint32_t>(1, 257);
  std::vector<uint8_t> labels(scene.mesh.vertices.size());
  for (size_t v = 0; v < labels.size(); ++v) {
    labels[v] = static_cast<uint8_t>(hash(static_cast<uint32_t>(v / 16), seed) % kinds);
  }
  if (*rc::gen::arbitrary<bool>()) scene.paint(seed);
  FrameContent content = scene.content(0);
  content.labels = labels;
  const auto frame = FrameEncoder({}).encode(content).value();
  FrameDecoder decoder;
  RC_ASSERT(decoder.decode(frame) == DecodeStatus::kOk);
  RC_ASSERT(decoder.frame().labels == labels);
  RC_ASSERT(decoder.frame().colours.size() == content.colours.size());
}

std::vector<uint8_t> alternating_labels(size_t vertices, size_t period) {
  std::vector<uint8_t> labels(vertices);
  for (size_t v = 0; v < vertices; ++v) labels[v] = static_cast<uint8_t>(1 + v / period % 2);
  return labels;
}

TEST(FrameReviser, adds_labels_to_a_sequence_and_keeps_the_rest) {
  const auto given = moving_ball(6);
  FrameReviser labeller, again;
  FrameDecoder before, after;
  for (const auto& frame : given) {
    ASSERT_EQ(labeller.decode(frame), DecodeStatus::kOk);
    const auto labels = alternating_labels(labeller.frame().positions.size(), 100);
    const auto labelled = labeller.labelled(labels);
    ASSERT_EQ(before.decode(frame), DecodeStatus::kOk);
    ASSERT_EQ(after.decode(labelled), DecodeStatus::kOk);
    EXPECT_TRUE(same(after.frame(), before.frame()));
    EXPECT_EQ(after.frame().labels, labels);
    ASSERT_EQ(again.decode(labelled), DecodeStatus::kOk);
    EXPECT_EQ(again.labelled({}), frame) << "labels can be removed";
  }
}

TEST(FrameReviser, replaces_labels) {
  FrameReviser labeller;
  ASSERT_EQ(labeller.decode(moving_ball(1)[0]), DecodeStatus::kOk);
  const size_t vertices = labeller.frame().positions.size();
  const auto first = labeller.labelled(alternating_labels(vertices, 10));
  ASSERT_EQ(labeller.decode(first), DecodeStatus::kOk);
  FrameDecoder decoder;
  ASSERT_EQ(decoder.decode(labeller.labelled(alternating_labels(vertices, 7))), DecodeStatus::kOk);
  EXPECT_EQ(decoder.frame().labels, alternating_labels(vertices, 7));
}

TEST(FrameCodec, labels_of_two_parts_cost_few_bytes) {
  Scene scene(ball(15));
  scene.paint(1);
  std::vector<uint8_t> labels;
  for (const auto& at : scene.mesh.vertices) {
    labels.push_back(at.x() < scene.mesh.vertices[0].x() ? 1 : 2);
  }
  FrameContent content = scene.content(0);
  const size_t without = FrameEncoder({}).encode(content).value().size();
  content.labels = labels;
  const size_t with = FrameEncoder({}).encode(content).value().size();
  EXPECT_LT(with - without, labels.size() / 50) << labels.size() << " vertices";
}

TEST(FrameCodec, rejects_labels_that_are_no_byte_or_too_few) {
  const Scene scene(ball(5));
  std::vector<uint8_t> labels(scene.mesh.vertices.size() - 1, 1);
  FrameContent content = scene.content(0);
  content.labels = labels;
  EXPECT_FALSE(FrameEncoder({}).encode(content));
  labels.push_back(1);
  content.labels = labels;
  auto frame = FrameEncoder({}).encode(content).value();
  FrameDecoder decoder;
  ASSERT_EQ(decoder.decode(frame), DecodeStatus::kOk);
  const auto header = read_header(frame).value();
  const size_t bytes = section(frame, header, kLabels).size();
  std::fill(frame.end() - static_cast<std::ptrdiff_t>(bytes), frame.end(), uint8_t{0xFF});
  EXPECT_EQ(decoder.decode(with_valid_checksum(frame)), DecodeStatus::kMalformed);
}

RC_GTEST_PROP(FrameCodec, rejects_hostile_bytes_or_decodes_a_valid_mesh, ()) {
  static const auto kFrames = moving_ball(2);
  FrameDecoder decoder;
  decoder.decode(kFrames[0]);
  std::vector<uint8_t> frame = kFrames[*rc::gen::inRange(0, 2)];
  for (int changes = *rc::gen::inRange(1, 4); changes > 0; --changes) {
    frame[*rc::gen::inRange<size_t>(16, frame.size())] = *rc::gen::arbitrary<uint8_t>();
  }
  if (decoder.decode(with_valid_checksum(frame)) != DecodeStatus::kOk) return;
  for (const auto& triangle : decoder.frame().triangles) {
    for (const uint32_t v : triangle) RC_ASSERT(v < decoder.frame().positions.size());
  }
}

TEST(FrameCodec, rejects_counts_that_differ_from_the_surface) {
  auto frame = moving_ball(1)[0];
  FrameDecoder decoder;
  frame[92] ^= 1;
  EXPECT_EQ(decoder.decode(with_valid_checksum(frame)), DecodeStatus::kMalformed);
}

TEST(Occupancy, rejects_a_volume_of_too_many_bricks) {
  const auto fits = [](int layers) {
    const std::vector<Brick> bricks(64 * 64 * layers, Brick{1});
    std::vector<BrickCoord> coords;
    for (int n = 0; n < 64 * 64 * layers; ++n) coords.push_back({n % 64, n / 64 % 64, n / 4096});
    return Occupancy().assign({nullptr, bricks, coords});
  };
  EXPECT_TRUE(fits(32));
  EXPECT_FALSE(fits(33));
}

TEST(Occupancy, rejects_a_narrow_volume_of_too_many_rows) {
  const auto fits = [](BrickCoord last) {
    const std::vector<Brick> bricks(2, Brick{1});
    const std::vector<BrickCoord> coords{{0, 0, 0}, last};
    return Occupancy().assign({nullptr, bricks, coords});
  };
  EXPECT_TRUE(fits({63, 511, 511}));
  EXPECT_TRUE(fits({0, 1023, 1023}));
  EXPECT_FALSE(fits({0, 1024, 1023}));
}

/// Checksum of all arrays of a decoded frame.
uint32_t checksum_of(const DecodedFrame& frame) {
  std::vector<uint8_t> bytes;
  const auto add = [&](const auto& numbers) {
    const auto* first = reinterpret_cast<const uint8_t*>(numbers.data());
    bytes.insert(bytes.end(), first, first + numbers.size() * sizeof(numbers[0]));
  };
  add(frame.positions);
  add(frame.triangles);
  add(frame.colours);
  return crc32(bytes);
}

/// The two frames in a file of the fuzzing corpus. The file holds the length of the first frame and
/// both frames.
std::array<std::vector<uint8_t>, 2> frames_in(const std::string& file) {
  std::ifstream in(V3D_CORPUS "/" + file, std::ios::binary);
  const std::vector<char> text(std::istreambuf_iterator<char>(in), {});
  const std::span<const uint8_t> bytes(reinterpret_cast<const uint8_t*>(text.data()), text.size());
  const auto first = bytes.subspan(2, static_cast<size_t>(bytes[0] | bytes[1] << 8));
  const auto second = bytes.subspan(2 + first.size());
  return {std::vector<uint8_t>(first.begin(), first.end()),
          std::vector<uint8_t>(second.begin(), second.end())};
}

/// Checksums of the two frames in a file of the fuzzing corpus.
std::vector<uint32_t> checksums_in(const std::string& file) {
  FrameDecoder decoder;
  std::vector<uint32_t> sums;
  for (const std::vector<uint8_t>& frame : frames_in(file)) {
    EXPECT_EQ(decoder.decode(frame), DecodeStatus::kOk);
    sums.push_back(checksum_of(decoder.frame()));
  }
  return sums;
}

TEST(FrameCodec, decodes_stored_frames_as_an_independent_decoder_did) {
  using Sums = std::vector<uint32_t>;
  EXPECT_EQ(checksums_in("key-and-next"), (Sums{0x3BE1625E, 0x53013808}));
  EXPECT_EQ(checksums_in("moved"), (Sums{0x9A1D176E, 0x9A1D176E}));
  EXPECT_EQ(checksums_in("any-mesh"), (Sums{0x56100BDB, 0x2B1E6B71}));
}

TEST(FrameCodec, has_inputs_of_its_fuzzer_that_decode_with_every_flag) {
  constexpr unsigned kAll = FrameHeader::kColours | FrameHeader::kDisplaced | FrameHeader::kInter |
                            FrameHeader::kExplicit | FrameHeader::kLabelled |
                            FrameHeader::kCameras | FrameHeader::kLate;
  unsigned flags = 0;
  int with_views = 0;
  for (const auto& entry : std::filesystem::directory_iterator(V3D_CORPUS)) {
    FrameDecoder decoder;
    decoder.enable_cameras(true);
    for (const std::vector<uint8_t>& frame : frames_in(entry.path().filename().string())) {
      if (decoder.decode(frame) != DecodeStatus::kOk) continue;
      flags |= read_header(frame).value().flags;
      if (!decoder.frame().cameras.empty()) ++with_views;
    }
  }
  EXPECT_EQ(flags, kAll);
  EXPECT_EQ(with_views, 4) << "two key frames and their next ones";
}

TEST(CDecoder, decodes_a_frame_from_c) {
  const auto frame = moving_ball(1)[0];
  EXPECT_EQ(vertices_in_c(frame.data(), frame.size()), Scene(ball(8)).mesh.vertices.size());
  EXPECT_EQ(vertices_in_c(frame.data(), frame.size() - 1), 0U);
}

}  // namespace
}  // namespace v3d::codec
