// Motion files in C, in WebAssembly, and by a decoder that was written from the document.
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdio>
#include <filesystem>
#include <fstream>

#include "codec/byte_stream.h"
#include "codec/v3d_decoder.h"
#include "tests/codec/motion_scene.h"

extern "C" size_t motion_vertices_in_c(const uint8_t* bytes, size_t size);

namespace v3d::codec {
namespace {

/// Two segments, the second without colours and confidences.
std::vector<uint8_t> two_segments() {
  MotionSegment first = moving_tube(11), second = random_segment(7, 3, 40, 60);
  paint(first, 12);
  for (int64_t& pulse : second.pulses) pulse += 1000;
  return motion_file({first, second}, {.key_every = 4});
}

template <class Numbers>
void append(std::string& text, const Numbers& numbers) {
  text.append(reinterpret_cast<const char*>(numbers.data()), numbers.size() * sizeof(numbers[0]));
}

/// Decodes natively; the format is that of decode_motion.mjs.
std::string decoded_here(const std::vector<uint8_t>& file) {
  auto reader = MotionReader::open(file);
  std::string text;
  for (size_t s = 0; s < reader->segments().size(); ++s) {
    const MotionSegmentInfo& info = reader->segments()[s];
    std::vector<double> facts{static_cast<double>(info.key), static_cast<double>(info.vertices),
                              static_cast<double>(info.triangles), info.step_m};
    facts.insert(facts.end(), info.pulses.begin(), info.pulses.end());
    append(text, facts);
    append(text, reader->surface(s)->positions);
    append(text, reader->surface(s)->colours);
    append(text, reader->surface(s)->triangles);
    for (size_t p = info.pulses.size(); p-- > 0;) {
      const MotionPulse& pulse = *reader->decode(s, p);
      append(text, std::vector<double>{static_cast<double>(pulse.pulse)});
      append(text, pulse.positions);
      append(text, pulse.colours);
      append(text, pulse.confidences);
    }
  }
  return text;
}

/// The bytes at `data`; none for a null pointer.
void append(std::string& text, const void* data, size_t bytes) {
  if (data != nullptr) text.append(static_cast<const char*>(data), bytes);
}

std::string decoded_by_library(const std::vector<uint8_t>& file) {
  v3d_motion* motion = nullptr;
  EXPECT_EQ(v3d_motion_open(&motion, file.data(), file.size()), V3D_OK);
  std::string text;
  for (size_t s = 0; s < v3d_motion_segments(motion); ++s) {
    const v3d_motion_segment& info = *v3d_motion_segment_at(motion, s);
    std::vector<double> facts{static_cast<double>(info.key), static_cast<double>(info.vertices),
                              static_cast<double>(info.triangles), info.step_m};
    facts.insert(facts.end(), info.pulse_numbers, info.pulse_numbers + info.pulses);
    append(text, facts);
    const v3d_motion_surface& surface = *v3d_motion_surface_of(motion, s);
    append(text, surface.positions, 12 * surface.vertices);
    append(text, surface.colours, 3 * surface.vertices);
    append(text, surface.indices, 12 * surface.triangles);
    for (size_t p = info.pulses; p-- > 0;) {
      const v3d_motion_pulse& pulse = *v3d_motion_decode(motion, s, p);
      append(text, std::vector<double>{static_cast<double>(pulse.pulse)});
      append(text, pulse.positions, 12 * pulse.vertices);
      append(text, pulse.colours, 3 * pulse.vertices);
      append(text, pulse.confidences, pulse.vertices);
    }
  }
  v3d_motion_free(motion);
  return text;
}

TEST(MotionLibrary, decodes_in_c_to_the_same_bits_as_in_cpp) {
  const auto file = two_segments();
  EXPECT_TRUE(decoded_by_library(file) == decoded_here(file));
  EXPECT_EQ(motion_vertices_in_c(file.data(), file.size()), 240);
}

TEST(MotionLibrary, reports_damaged_files_and_segments_beyond_the_last) {
  auto file = two_segments();
  v3d_motion* motion = nullptr;
  EXPECT_EQ(v3d_motion_open(&motion, file.data(), file.size() - 1), V3D_MALFORMED);
  EXPECT_EQ(motion, nullptr);
  file.back() ^= 1;
  ASSERT_EQ(v3d_motion_open(&motion, file.data(), file.size()), V3D_OK);
  EXPECT_EQ(v3d_motion_decode(motion, 1, 2), nullptr);
  EXPECT_NE(v3d_motion_decode(motion, 1, 0), nullptr);
  EXPECT_EQ(v3d_motion_segment_at(motion, 2), nullptr);
  EXPECT_EQ(v3d_motion_surface_of(motion, 2), nullptr);
  v3d_motion_free(motion);
}

/// Standard output of `program`, a command to which the name of a file with `bytes` is appended.
std::string output_for(const std::string& program, const std::vector<uint8_t>& bytes) {
  // Tests run at the same time, each in a process of its own.
  const auto file =
      std::filesystem::path(testing::TempDir()) / ("v3d-motion-file-" + std::to_string(getpid()));
  std::ofstream(file, std::ios::binary)
      .write(reinterpret_cast<const char*>(bytes.data()),
             static_cast<std::streamsize>(bytes.size()));
  FILE* pipe = popen((program + " " + file.string()).c_str(), "r");
  std::string text;
  std::vector<char> part(1 << 16);
  while (const size_t more = fread(part.data(), 1, part.size(), pipe)) text.append(&part[0], more);
  EXPECT_EQ(pclose(pipe), 0) << program << " failed; is it installed? Run tools/install-deps";
  std::filesystem::remove(file);
  return text;
}

TEST(MotionDocument, suffices_to_write_a_decoder_that_returns_the_same_bits) {
  MotionSegment given = moving_tube(12, 10, 9);
  paint(given, 10);
  const auto file = motion_file({given}, {.step_m = 0.0003, .key_every = 9});
  auto reader = MotionReader::open(file);
  uint32_t checksum = 0;
  for (size_t p = 0; p < given.pulses.size(); ++p) {
    const MotionPulse& pulse = *reader->decode(0, p);
    std::string text;
    append(text, pulse.positions);
    append(text, pulse.colours);
    append(text, pulse.confidences);
    checksum = crc32({reinterpret_cast<const uint8_t*>(text.data()), text.size()}, checksum);
  }
  EXPECT_EQ(output_for("python3 " V3D_MOTION_REFERENCE, file), std::to_string(checksum) + "\n");
}

#ifdef V3D_WASM
TEST(MotionLibrary, decodes_in_webassembly_to_the_same_bits_as_in_cpp) {
  const auto file = two_segments();
  EXPECT_TRUE(output_for("node " V3D_DECODE_MOTION_MJS " " V3D_WASM, file) == decoded_here(file));
}
#endif

}  // namespace
}  // namespace v3d::codec
