#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <set>

#include "sim/rendering/scene.h"
#include "tests/codec/motion_scene.h"

namespace v3d::codec {
namespace {

/// All pulses of a segment, decoded in order.
std::vector<MotionPulse> decoded(const std::vector<uint8_t>& file, size_t segment = 0) {
  auto reader = MotionReader::open(file);
  std::vector<MotionPulse> pulses;
  if (!reader) return pulses;
  for (size_t p = 0; p < reader->segments().at(segment).pulses.size(); ++p) {
    const MotionPulse* pulse = reader->decode(segment, p);
    if (pulse == nullptr) return {};
    pulses.push_back(*pulse);
  }
  return pulses;
}

/// Greatest difference along an axis, metres.
double position_error(const MotionSegment& given, const EncodedMotion& encoded,
                      const std::vector<MotionPulse>& pulses) {
  double worst = 0;
  for (size_t p = 0; p < given.pulses.size(); ++p) {
    for (size_t v = 0; v < encoded.order.size(); ++v) {
      for (size_t axis = 0; axis < 3; ++axis) {
        const double wanted = given.positions[p][encoded.order[v]][axis];
        worst = std::max(worst, std::abs(wanted - pulses.at(p).positions.at(v)[axis]));
      }
    }
  }
  return worst;
}

std::vector<uint8_t> file_of(const EncodedMotion& encoded) {
  std::vector<uint8_t> file = MotionWriter::header();
  file.insert(file.end(), encoded.bytes.begin(), encoded.bytes.end());
  return file;
}

/// The triangles in one order, each turned to the least of its three forms.
std::multiset<VertexTriangle> sorted(const std::vector<VertexTriangle>& triangles) {
  std::multiset<VertexTriangle> all;
  for (VertexTriangle t : triangles) {
    const VertexTriangle second{t[1], t[2], t[0]}, third{t[2], t[0], t[1]};
    all.insert(std::min({t, second, third}));
  }
  return all;
}

void expect_equal(const MotionPulse& a, const MotionPulse& b) {
  EXPECT_EQ(a.pulse, b.pulse);
  EXPECT_TRUE(a.positions == b.positions);
  EXPECT_TRUE(a.colours == b.colours);
  EXPECT_TRUE(a.confidences == b.confidences);
}

TEST(MotionCodec, decodes_positions_within_half_a_step_along_each_axis) {
  const MotionSegment given = moving_tube(30);
  for (const double step : {0.01, 0.0005, 0.0001, 0.00001}) {
    const auto encoded = encode_motion(given, {.step_m = step});
    ASSERT_TRUE(encoded);
    // Positions are rounded to binary32.
    EXPECT_LE(position_error(given, *encoded, decoded(file_of(*encoded))), step / 2 + 2e-7);
  }
}

TEST(MotionCodec, decodes_the_triangles_of_the_input_with_its_orientation) {
  const MotionSegment given = moving_tube(2);
  const auto encoded = encode_motion(given, {});
  const std::vector<uint8_t> file = file_of(*encoded);
  auto reader = MotionReader::open(file);
  auto triangles = reader->surface(0)->triangles;
  for (VertexTriangle& t : triangles) {
    for (uint32_t& corner : t) corner = encoded->order[corner];
  }
  EXPECT_EQ(sorted(triangles), sorted(given.triangles));
}

TEST(MotionCodec, decodes_pulses_in_any_order_to_the_same_bits_as_in_sequence) {
  MotionSegment given = moving_tube(40);
  paint(given, 10);
  const auto file = motion_file({given}, {.key_every = 12});
  const auto in_order = decoded(file);
  ASSERT_EQ(in_order.size(), 40);
  auto reader = MotionReader::open(file);
  for (const size_t p : {39, 0, 38, 37, 5, 20, 12, 11, 13, 36, 24, 1, 30, 29, 3}) {
    const MotionPulse* pulse = reader->decode(0, p);
    ASSERT_NE(pulse, nullptr);
    expect_equal(*pulse, in_order[p]);
  }
}

TEST(MotionCodec, decodes_a_pulse_although_others_are_damaged) {
  const auto given = moving_tube(30);
  auto file = motion_file({given}, {.key_every = 8});
  const auto in_order = decoded(file);
  file.back() ^= 1;  // the last pulse
  auto reader = MotionReader::open(file);
  EXPECT_EQ(reader->decode(0, 29), nullptr);
  EXPECT_EQ(reader->decode(0, 28), nullptr) << "needs the last pulse";
  for (size_t p = 0; p <= 24; ++p) expect_equal(*reader->decode(0, p), in_order[p]);
}

TEST(MotionCodec, encodes_equal_segments_to_equal_bytes) {
  MotionSegment given = moving_tube(20);
  paint(given, 5);
  EXPECT_TRUE(motion_file({given}) == motion_file({given}));
}

TEST(MotionCodec, repeats_constant_colours_in_each_pulse) {
  MotionSegment given = moving_tube(6);
  paint(given, 0);
  given.colours.resize(1);
  const auto encoded = encode_motion(given, {.colour_steps = {1, 1, 1}});
  EXPECT_EQ(encoded->parts.colours, 0);
  for (const MotionPulse& pulse : decoded(file_of(*encoded))) {
    for (size_t v = 0; v < encoded->order.size(); ++v) {
      EXPECT_EQ(pulse.colours[v], given.colours[0][encoded->order[v]]);
    }
  }
}

TEST(MotionCodec, follows_colours_that_change_within_a_step) {
  MotionSegment given = moving_tube(12);
  paint(given, 20);
  const ColourSteps steps{6, 15, 12};
  const auto encoded = encode_motion(given, {.colour_steps = steps});
  const auto pulses = decoded(file_of(*encoded));
  ASSERT_EQ(pulses.size(), 12);
  int worst = 0;
  for (size_t p = 0; p < pulses.size(); ++p) {
    for (size_t v = 0; v < encoded->order.size(); ++v) {
      for (size_t c = 0; c < 3; ++c) {
        const int wanted = given.colours[p][encoded->order[v]][c];
        worst = std::max(worst, std::abs(wanted - pulses[p].colours[v][c]));
      }
    }
  }
  // Errors below a step of luma, half of Cg and half of Co add up in blue, and are rounded twice.
  EXPECT_LE(worst, 5 + 11 / 2 + 14 / 2 + 2);
  EXPECT_GT(worst, 0);
}

TEST(MotionCodec, keeps_which_vertices_are_only_predicted) {
  MotionSegment given = moving_tube(9);
  paint(given, 0);
  for (const size_t levels : {2, 3, 4, 8}) {
    const auto encoded = encode_motion(given, {.confidence_levels = levels});
    const auto pulses = decoded(file_of(*encoded));
    ASSERT_EQ(pulses.size(), 9);
    for (size_t v = 0; v < encoded->order.size(); ++v) {
      const int wanted = given.confidences[8][encoded->order[v]];
      EXPECT_EQ(pulses[8].confidences[v] == 0, wanted == 0);
      EXPECT_LE(std::abs(pulses[8].confidences[v] - wanted), 255 / static_cast<int>(levels - 1));
    }
  }
}

TEST(MotionCodec, encodes_one_pulse_and_surfaces_without_triangles_or_vertices) {
  for (const auto& given : {moving_tube(1), random_segment(1, 3, 5, 0), random_segment(1, 2, 0, 0),
                            random_segment(1, 1, 1, 0), random_segment(1, 2, 1, 3)}) {
    const auto encoded = encode_motion(given, {.step_m = 0.001});
    ASSERT_TRUE(encoded);
    const auto pulses = decoded(file_of(*encoded));
    ASSERT_EQ(pulses.size(), given.pulses.size());
    EXPECT_LE(position_error(given, *encoded, pulses), 0.00051);
  }
}

TEST(MotionCodec, reads_a_file_without_segments) {
  const auto file = MotionWriter::header();
  auto reader = MotionReader::open(file);
  ASSERT_TRUE(reader);
  EXPECT_TRUE(reader->segments().empty());
  EXPECT_EQ(reader->surface(0), nullptr);
  EXPECT_EQ(reader->decode(0, 0), nullptr);
}

TEST(MotionCodec, rejects_content_and_options_that_break_a_rule) {
  const auto rejects = [](auto change) {
    MotionSegment given = moving_tube(3);
    paint(given, 0);
    MotionEncoderOptions options;
    change(given, options);
    return !encode_motion(given, options);
  };
  using Segment = MotionSegment;
  using Options = MotionEncoderOptions;
  EXPECT_FALSE(rejects([](Segment&, Options&) {}));
  EXPECT_TRUE(rejects([](Segment& s, Options&) { s = {}; }));
  EXPECT_TRUE(rejects([](Segment& s, Options&) { s.pulses[1] = s.pulses[0]; }));
  EXPECT_TRUE(rejects([](Segment& s, Options&) { s.pulses[0] = -1; }));
  EXPECT_TRUE(rejects([](Segment& s, Options&) { s.key = 3; }));
  EXPECT_TRUE(rejects([](Segment& s, Options&) { s.positions.pop_back(); }));
  EXPECT_TRUE(rejects([](Segment& s, Options&) { s.positions[1].pop_back(); }));
  EXPECT_TRUE(rejects([](Segment& s, Options&) { s.positions[1][4][2] = NAN; }));
  EXPECT_TRUE(rejects([](Segment& s, Options&) { s.positions[1][4][2] = INFINITY; }));
  EXPECT_TRUE(rejects([](Segment& s, Options&) { s.positions[1][4][2] = 2000; }));
  EXPECT_TRUE(rejects([](Segment& s, Options&) { s.triangles[0][1] = 240; }));
  EXPECT_TRUE(rejects([](Segment& s, Options&) { s.colours.pop_back(); }));
  EXPECT_TRUE(rejects([](Segment& s, Options&) { s.confidences[0].pop_back(); }));
  EXPECT_TRUE(rejects([](Segment&, Options& o) { o.step_m = 0; }));
  EXPECT_TRUE(rejects([](Segment&, Options& o) { o.step_m = NAN; }));
  EXPECT_TRUE(rejects([](Segment&, Options& o) { o.key_every = 0; }));
  EXPECT_TRUE(rejects([](Segment&, Options& o) { o.key_every = 257; }));
  EXPECT_TRUE(rejects([](Segment&, Options& o) { o.confidence_levels = 9; }));
  EXPECT_TRUE(rejects([](Segment&, Options& o) { o.colour_steps[1] = 0; }));
}

TEST(MotionWriter, makes_a_file_of_segments_whose_pulses_follow_each_other) {
  MotionSegment first = moving_tube(5), second = random_segment(3, 4, 30, 50);
  for (int64_t& pulse : second.pulses) pulse += 105;
  MotionWriter writer({});
  EXPECT_TRUE(writer.add(first));
  EXPECT_FALSE(writer.add(first)) << "pulses overlap";
  EXPECT_TRUE(writer.add(second));
  const auto file = motion_file({first, second});
  auto reader = MotionReader::open(file);
  ASSERT_EQ(reader->segments().size(), 2);
  EXPECT_EQ(reader->segments()[1].pulses, second.pulses);
  EXPECT_EQ(reader->segments()[1].key, second.key);
  expect_equal(*reader->decode(1, 2), decoded(file, 1).at(2));
  EXPECT_EQ(reader->decode(0, 4)->pulse, 104);
  EXPECT_EQ(reader->decode(0, 5), nullptr);
  EXPECT_EQ(reader->decode(2, 0), nullptr);
}

TEST(MotionWriter, takes_a_segment_that_is_encoded_already_as_one_that_it_encodes) {
  const MotionSegment first = moving_tube(5);
  MotionSegment second = random_segment(3, 4, 30, 50);
  for (int64_t& pulse : second.pulses) pulse += 105;
  const auto encoded = encode_motion(first, {});
  ASSERT_TRUE(encoded);
  EXPECT_EQ(encoded->bytes, MotionWriter({}).add(first)->bytes);
  const uint64_t limit = MotionWriter::header().size() + encoded->bytes.size();
  MotionWriter writer({}, {.bytes = limit});
  EXPECT_TRUE(writer.add_encoded(first.pulses, encoded->bytes.size()));
  EXPECT_FALSE(writer.add_encoded(first.pulses, encoded->bytes.size())) << "pulses overlap";
  EXPECT_FALSE(writer.is_full());
  EXPECT_FALSE(writer.add_encoded(second.pulses, 1)) << "no room";
  EXPECT_TRUE(writer.is_full());
}

TEST(MotionWriter, lets_a_segment_begin_at_the_last_pulse_of_the_one_before) {
  MotionSegment first = moving_tube(5), second = random_segment(3, 4, 30, 50);
  const int64_t shared = first.pulses.back();
  const int64_t shift = shared - second.pulses.front();
  for (int64_t& pulse : second.pulses) pulse += shift;
  const auto file = motion_file({first, second});
  auto reader = MotionReader::open(file);
  ASSERT_TRUE(reader);
  ASSERT_EQ(reader->segments().size(), 2);
  EXPECT_EQ(reader->decode(0, 4)->pulse, shared);
  EXPECT_EQ(reader->decode(1, 0)->pulse, shared);
  for (int64_t& pulse : second.pulses) --pulse;
  MotionWriter writer({});
  EXPECT_TRUE(writer.add(first));
  EXPECT_FALSE(writer.add(second)) << "two pulses are shared";
}

/// A tube at two pulses, the first of which is `pulse`.
MotionSegment tube_from(int64_t pulse) {
  MotionSegment tube = moving_tube(2);
  tube.pulses = {pulse, pulse + 1};
  return tube;
}

TEST(MotionWriter, makes_no_file_of_more_segments_than_decoders_accept) {
  EXPECT_EQ(MotionFileLimits().segments, MotionLimits::kSegments);
  MotionWriter writer({}, {.segments = 2});
  EXPECT_TRUE(writer.add(tube_from(0)));
  EXPECT_TRUE(writer.add(tube_from(2)));
  EXPECT_FALSE(writer.is_full());
  EXPECT_FALSE(writer.add(tube_from(4)));
  EXPECT_TRUE(writer.is_full());
  MotionSegment next = tube_from(4);
  EXPECT_FALSE(writer.add_first_pulses(next));
}

TEST(MotionWriter, makes_no_file_that_is_longer_than_its_limit) {
  const uint64_t bytes = motion_file({tube_from(0), tube_from(2)}).size();
  for (const uint64_t limit : {bytes, bytes - 1}) {
    MotionWriter writer({}, {.bytes = limit});
    EXPECT_TRUE(writer.add(tube_from(0)));
    EXPECT_EQ(writer.add(tube_from(2)).has_value(), limit == bytes);
    EXPECT_EQ(writer.is_full(), limit < bytes);
  }
}

TEST(MotionWriter, shortens_a_segment_to_the_pulses_for_which_the_file_has_room) {
  MotionSegment whole = moving_tube(20);
  paint(whole, 3);
  whole.key = 19;
  const uint64_t bytes = motion_file({whole}).size();
  const uint64_t less = encode_motion(whole, {})->parts.positions / 2;
  for (const uint64_t limit : {bytes, bytes - 1, bytes - less}) {
    MotionSegment given = whole;
    MotionWriter writer({}, {.bytes = limit});
    const auto encoded = writer.add_first_pulses(given);
    ASSERT_TRUE(encoded) << limit;
    EXPECT_EQ(given.pulses.size() == whole.pulses.size(), limit == bytes);
    EXPECT_EQ(writer.is_full(), limit < bytes);
    const auto file = file_of(*encoded);
    EXPECT_LE(file.size(), limit);
    auto reader = MotionReader::open(file);
    ASSERT_TRUE(reader);
    EXPECT_EQ(reader->segments().at(0).pulses, given.pulses);
    EXPECT_LE(position_error(given, *encoded, decoded(file)), 0.000251);
  }
  MotionWriter writer({}, {.bytes = 200});
  EXPECT_FALSE(writer.add_first_pulses(whole));
  EXPECT_TRUE(writer.is_full());
}

RC_GTEST_PROP(MotionCodec, decodes_any_mesh_within_half_a_step, ()) {
  const auto seed = *rc::gen::inRange<uint32_t>(0, 1000);
  const auto vertices = *rc::gen::inRange<uint32_t>(1, 60);
  const auto triangles = *rc::gen::inRange<size_t>(0, 150);
  const auto pulses = *rc::gen::inRange<size_t>(1, 12);
  const auto key_every = *rc::gen::inRange(1, 14);
  MotionSegment given = random_segment(seed, pulses, vertices, triangles);
  paint(given, 30, seed);
  const auto encoded = encode_motion(given, {.step_m = 0.001, .key_every = key_every});
  RC_ASSERT(encoded.has_value());
  const auto file = file_of(*encoded);
  const auto all = decoded(file);
  RC_ASSERT(all.size() == pulses);
  RC_ASSERT(position_error(given, *encoded, all) <= 0.000505);
  auto reader = MotionReader::open(file);
  auto surface = reader->surface(0)->triangles;
  for (VertexTriangle& t : surface) {
    for (uint32_t& corner : t) corner = encoded->order[corner];
  }
  RC_ASSERT(sorted(surface) == sorted(given.triangles));
}

TEST(MotionCodec, codes_rigid_motion_in_less_than_half_a_bit_for_each_vertex) {
  MotionSegment given = moving_tube(1, 60, 40);
  given.pulses.clear();
  const auto rest = given.positions[0];
  given.positions.clear();
  for (int p = 0; p < 26; ++p) {
    given.pulses.push_back(p);
    auto moved = rest;
    for (VertexPosition& v : moved) v[0] += 0.008F * static_cast<float>(p);
    given.positions.push_back(moved);
  }
  const auto encoded = encode_motion(given, {.step_m = 0.0005});
  EXPECT_LT(8.0 * static_cast<double>(encoded->parts.positions), 0.5 * 26 * 2400);
}

TEST(MotionCodec, codes_a_performer_in_less_than_five_bits_for_each_vertex_and_pulse) {
  MotionSegment given;
  for (int p = 0; p < 13; ++p) {
    const Mesh mesh = sim::performer_at(1.5 + p / 25.0, 1);
    given.pulses.push_back(p);
    auto& positions = given.positions.emplace_back();
    for (const auto& v : mesh.vertices) positions.push_back({v.x(), v.y(), v.z()});
    given.triangles = mesh.triangles;
  }
  const auto encoded = encode_motion(given, {.step_m = 0.0005});
  ASSERT_TRUE(encoded);
  const double vertices = static_cast<double>(encoded->order.size());
  EXPECT_LT(8.0 * static_cast<double>(encoded->parts.positions) / (13 * vertices), 5);
  EXPECT_LT(8.0 * static_cast<double>(encoded->parts.triangles) / (2 * vertices), 2);
}

}  // namespace
}  // namespace v3d::codec
