// Bytes from outside: each is rejected or decoded within the limits.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <fstream>
#include <iterator>
#include <set>

#include "codec/byte_stream.h"
#include "tests/codec/motion_scene.h"

namespace v3d::codec {
namespace {

constexpr size_t kSegment = 16, kHeader = 96;

/// A small file with all parts.
std::vector<uint8_t> small_file() {
  MotionSegment given = moving_tube(4, 4, 5);
  paint(given, 10);
  return motion_file({given}, {.step_m = 0.002, .key_every = 2});
}

/// Number of pulses and of the template that are decoded; checks their sizes.
size_t decodable(const std::vector<uint8_t>& file) {
  auto reader = MotionReader::open(file);
  if (!reader) return 0;
  size_t parts = 0;
  for (size_t s = 0; s < reader->segments().size(); ++s) {
    const MotionSegmentInfo& info = reader->segments()[s];
    const MotionTemplate* surface = reader->surface(s);
    if (surface == nullptr) continue;
    ++parts;
    EXPECT_EQ(surface->triangles.size(), info.triangles);
    for (const VertexTriangle& t : surface->triangles) {
      for (const uint32_t corner : t) EXPECT_LT(corner, info.vertices);
    }
    for (size_t p = 0; p < info.pulses.size(); ++p) {
      const MotionPulse* pulse = reader->decode(s, p);
      if (pulse == nullptr) continue;
      ++parts;
      EXPECT_EQ(pulse->positions.size(), info.vertices);
      EXPECT_EQ(pulse->colours.size(), info.coloured ? info.vertices : 0);
      EXPECT_EQ(pulse->confidences.size(), info.has_confidences ? info.vertices : 0);
    }
  }
  return parts;
}

template <class T>
void put(std::vector<uint8_t>& file, size_t at, T number) {
  std::memcpy(&file[at], &number, sizeof number);
}
template <class T>
T get(const std::vector<uint8_t>& file, size_t at) {
  T number;
  std::memcpy(&number, &file[at], sizeof number);
  return number;
}

/// Corrects all checksums of the first segment, as an attacker would.
void correct_checksums(std::vector<uint8_t>& file) {
  const auto pulses = get<uint32_t>(file, kSegment + 16);
  const size_t header = kHeader + 16 * pulses;
  size_t at = kSegment + header;
  const auto checksum = [&](size_t bytes) {
    const uint32_t sum = crc32(std::span(file).subspan(at, bytes));
    at += bytes;
    return sum;
  };
  size_t sections = 0;
  for (const size_t field : {48, 52, 56}) sections += get<uint32_t>(file, kSegment + field);
  put(file, kSegment + 44, checksum(sections));
  for (size_t p = 0; p < pulses; ++p) {
    const size_t entry = kSegment + kHeader + 16 * p;
    put(file, entry + 12, checksum(get<uint32_t>(file, entry + 8)));
  }
  put(file, kSegment + 4, crc32(std::span(file).subspan(kSegment + 8, header - 8)));
}

TEST(MotionBytes, a_file_that_ends_early_is_rejected) {
  const auto file = small_file();
  EXPECT_EQ(decodable(file), 5);
  for (size_t size = 0; size < file.size(); ++size) {
    const std::vector<uint8_t> cut(file.begin(), file.begin() + static_cast<std::ptrdiff_t>(size));
    // The header alone is a file without segments.
    EXPECT_EQ(MotionReader::open(cut).has_value(), size == kSegment);
  }
}

TEST(MotionBytes, a_changed_bit_is_noticed) {
  auto file = small_file();
  for (size_t at = 0; at < file.size(); ++at) {
    file[at] ^= static_cast<uint8_t>(1 << at % 8);
    EXPECT_LT(decodable(file), 5) << "byte " << at;
    file[at] ^= static_cast<uint8_t>(1 << at % 8);
  }
}

TEST(MotionBytes, changed_bytes_with_right_checksums_are_rejected_or_give_a_whole_surface) {
  const auto file = small_file();
  size_t whole = 0;
  for (size_t at = kSegment + kHeader + 16 * 4; at < file.size(); ++at) {
    for (const uint8_t change : {0x01, 0x80, 0xFF}) {
      auto changed = file;
      changed[at] ^= change;
      correct_checksums(changed);
      whole += decodable(changed);
    }
  }
  EXPECT_GT(whole, 0) << "the checksums are not corrected";
}

TEST(MotionBytes, changed_fields_of_the_header_are_rejected_or_give_a_whole_surface) {
  const auto file = small_file();
  for (size_t at = kSegment + 8; at < kSegment + kHeader + 16 * 4; ++at) {
    if (at >= kSegment + 16 && at < kSegment + 20) continue;  // pulses; below
    for (const uint8_t change : {0x01, 0x10, 0xFF}) {
      auto changed = file;
      changed[at] ^= change;
      const size_t header = kHeader + 16 * 4;
      put(changed, kSegment + 4, crc32(std::span(changed).subspan(kSegment + 8, header - 8)));
      decodable(changed);
    }
  }
}

TEST(MotionBytes, claimed_sizes_without_the_bytes_are_rejected) {
  struct Claim {
    size_t at;
    uint32_t value;
  };
  for (const Claim& claim :
       {Claim{16, 0}, Claim{16, 3}, Claim{16, 65536}, Claim{16, 0xFFFFFFFF}, Claim{20, 4},
        Claim{24, 0}, Claim{24, 257}, Claim{28, 0}, Claim{28, 1 << 19}, Claim{28, 0xFFFFFFFF},
        Claim{32, 1 << 20}, Claim{32, 0xFFFFFFFF}, Claim{48, 0xFFFFFFFF}, Claim{52, 0xFFFFFFFF},
        Claim{56, 0xFFFFFFFF}}) {
    auto file = small_file();
    put(file, kSegment + claim.at, claim.value);
    const size_t header = kHeader + 16 * 4;
    put(file, kSegment + 4, crc32(std::span(file).subspan(kSegment + 8, header - 8)));
    auto reader = MotionReader::open(file);
    EXPECT_TRUE(!reader || reader->surface(0) == nullptr) << claim.at << " " << claim.value;
  }
}

TEST(MotionBytes, fields_of_the_header_that_break_a_rule_are_rejected) {
  struct Field {
    size_t at;
    std::vector<uint8_t> bytes;
  };
  const auto bytes_of = [](auto number) {
    const auto* first = reinterpret_cast<const uint8_t*>(&number);
    return std::vector<uint8_t>(first, first + sizeof number);
  };
  for (const Field& field :
       {Field{36, {7}}, Field{36, {2}}, Field{37, {1}}, Field{37, {9}}, Field{38, {0}},
        Field{39, {65}}, Field{41, {1}}, Field{43, {1}}, Field{60, {1}}, Field{64, bytes_of(0.0)},
        Field{64, bytes_of(2.0)}, Field{64, bytes_of(double{NAN})}, Field{72, bytes_of(2e6)},
        Field{88, bytes_of(double{INFINITY})}, Field{80, bytes_of(double{NAN})},
        Field{kHeader, bytes_of(int64_t{-1})}, Field{kHeader + 16, bytes_of(int64_t{100})}}) {
    auto file = small_file();
    std::copy(field.bytes.begin(), field.bytes.end(), &file[kSegment + field.at]);
    correct_checksums(file);
    EXPECT_FALSE(MotionReader::open(file)) << field.at;
  }
}

/// Changes each byte behind the table in turn, and calls `check` with each pulse that is decoded.
template <class Check>
void for_changed_bytes(const std::vector<uint8_t>& file, const Check& check) {
  const size_t header = kHeader + 16 * get<uint32_t>(file, kSegment + 16);
  for (size_t at = kSegment + header; at < file.size(); ++at) {
    for (const uint8_t change : {0x01, 0x20, 0xC0}) {
      auto changed = file;
      changed[at] ^= change;
      correct_checksums(changed);
      auto reader = MotionReader::open(changed);
      for (size_t p = 0; reader && p < reader->segments()[0].pulses.size(); ++p) {
        if (const MotionPulse* pulse = reader->decode(0, p)) check(*pulse);
      }
    }
  }
}

TEST(MotionBytes, positions_off_the_lattice_are_rejected) {
  MotionSegment given = random_segment(3, 3, 20, 30);
  // The lattice covers little more than these.
  given.positions[0][0] = given.positions[1][3] = {-524, -524, -524};
  given.positions[1][0] = given.positions[2][7] = {524, 524, 524};
  const auto file = motion_file({given}, {.step_m = 0.0005});
  float greatest = 0;
  for_changed_bytes(file, [&](const MotionPulse& pulse) {
    for (const VertexPosition& p : pulse.positions) {
      for (const float metres : p) greatest = std::max(greatest, std::abs(metres));
    }
  });
  EXPECT_GT(greatest, 0);
  EXPECT_LE(greatest, 524.289F);
}

TEST(MotionBytes, levels_of_confidence_beyond_the_last_are_rejected) {
  MotionSegment given = moving_tube(3, 4, 5);
  paint(given, 10);
  const auto file = motion_file({given}, {.step_m = 0.002, .confidence_levels = 5});
  const std::set<uint8_t> valid{0, 64, 128, 191, 255};
  for_changed_bytes(file, [&](const MotionPulse& pulse) {
    for (const uint8_t confidence : pulse.confidences) {
      EXPECT_EQ(valid.count(confidence), 1) << int{confidence};
    }
  });
}

TEST(MotionBytes, a_stored_file_decodes_to_the_same_bits_as_when_it_was_made) {
  std::ifstream in(V3D_MOTION_CORPUS "/small.motion", std::ios::binary);
  const std::vector<uint8_t> file(std::istreambuf_iterator<char>(in), {});
  auto reader = MotionReader::open(file);
  ASSERT_TRUE(reader);
  uint32_t sum = 0;
  for (size_t p = 0; p < reader->segments().at(0).pulses.size(); ++p) {
    const MotionPulse* pulse = reader->decode(0, p);
    ASSERT_NE(pulse, nullptr);
    const auto add = [&](const auto& rows) {
      sum =
          crc32({reinterpret_cast<const uint8_t*>(rows.data()), rows.size() * sizeof rows[0]}, sum);
    };
    add(pulse->positions);
    add(pulse->colours);
    add(pulse->confidences);
  }
  EXPECT_EQ(sum, 4276962286U);
}

}  // namespace
}  // namespace v3d::codec
