#include "recon/compact_frame.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <tbb/global_control.h>
#include <zstd.h>

#include <bit>
#include <cstring>
#include <thread>

#include "base/error.h"
#include "shapes.h"

namespace v3d {
namespace {

/// A mesh on the lattice: any points, any triangles.
CompactFrame arbitrary_frame() {
  CompactFrame frame;
  frame.pulse = *rc::gen::inRange<int64_t>(0, 1'000'000);
  frame.exposure = from_ns<Realtime>(1'700'000'000'000'000'000 + frame.pulse);
  frame.cameras = {"cam01", "cam02", "left"};
  frame.missing = 2;
  frame.lattice = {{-1.5, *rc::gen::inRange(-1000, 1000) / 333.0, 0.017},
                   *rc::gen::inRange(1, 1000) / 77777.0};
  const auto vertices = *rc::gen::inRange<uint32_t>(1, 60);
  for (uint32_t v = 0; v < vertices; ++v) {
    Eigen::Vector3f p;
    for (int axis = 0; axis < 3; ++axis) {
      const int h = *rc::gen::inRange(0, 65536);
      p[axis] = static_cast<float>(frame.lattice.origin[axis] + h * frame.lattice.step);
    }
    frame.mesh.vertices.push_back(p);
    frame.mesh.colours.push_back({*rc::gen::arbitrary<uint8_t>(), *rc::gen::arbitrary<uint8_t>(),
                                  *rc::gen::arbitrary<uint8_t>()});
  }
  const auto index = rc::gen::inRange<uint32_t>(0, vertices);
  for (int t = *rc::gen::inRange(0, 80); t > 0; --t) {
    frame.mesh.triangles.push_back({*index, *index, *index});
  }
  return frame;
}

RC_GTEST_PROP(CompactFrame, gives_back_every_bit_of_a_lattice_mesh_in_coding_order, ()) {
  CompactFrame frame = arbitrary_frame();
  if (*rc::gen::arbitrary<bool>()) {
    frame.mesh.colours.clear();
  }
  const auto bytes = encode_compact(frame);
  const auto back = decode_compact(bytes);
  RC_ASSERT(back.has_value());
  const Mesh expected = in_coding_order(frame.mesh);
  RC_ASSERT(back->mesh.vertices == expected.vertices);
  RC_ASSERT(back->mesh.colours == expected.colours);
  RC_ASSERT(back->mesh.triangles == expected.triangles);
  RC_ASSERT(back->pulse == frame.pulse && back->exposure == frame.exposure);
  RC_ASSERT(back->cameras == frame.cameras && back->missing == frame.missing);
  RC_ASSERT(back->lattice == frame.lattice);
  RC_ASSERT(encode_compact(*back) == bytes);
}

TEST(CompactFrame, is_the_same_for_any_number_of_threads_and_whatever_was_coded_before) {
  CompactFrame large, small;
  small.lattice = large.lattice = {{-1, -1, -1}, 0.001};
  large.mesh = shapes::sphere({0, 0, 0}, 0.9F, 60);
  small.mesh = shapes::sphere({0.1F, 0, 0}, 0.5F, 20);
  std::vector<uint8_t> expected;
  std::thread([&] { expected = encode_compact(small); }).join();  // no context is used again here
  for (const size_t threads : {1, 2, 5}) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    encode_compact(large);
    EXPECT_EQ(encode_compact(small), expected);
  }
}

RC_GTEST_PROP(CompactFrame, with_a_changed_byte_gives_nothing_or_a_sound_mesh, ()) {
  auto bytes = encode_compact(arbitrary_frame());
  const auto where = *rc::gen::inRange<size_t>(0, bytes.size());
  bytes[where] = static_cast<uint8_t>(bytes[where] ^ *rc::gen::inRange(1, 256));
  if (const auto back = decode_compact(bytes)) {
    for (const auto& t : back->mesh.triangles) {
      for (const uint32_t v : t) {
        RC_ASSERT(v < back->mesh.vertices.size());
      }
    }
  }
}

CompactFrame small_frame() {
  CompactFrame frame;
  frame.pulse = 7;
  frame.cameras = {"cam01", "cam02"};
  frame.lattice = {{-1, -1, 0}, 0.005};
  frame.mesh = shapes::box({-0.5F, -0.5F, 0.5F}, {0.5F, 0.5F, 1.5F});
  frame.mesh.colours.assign(8, {10, 20, 30});
  return frame;
}

TEST(CompactFrame, cut_anywhere_gives_nothing) {
  const auto bytes = encode_compact(small_frame());
  ASSERT_TRUE(decode_compact(bytes));
  for (size_t size = 0; size < bytes.size(); ++size) {
    EXPECT_FALSE(decode_compact(std::span(bytes).first(size))) << size;
  }
  auto longer = bytes;
  longer.push_back(0);
  EXPECT_FALSE(decode_compact(longer));
}

template <class T>
std::vector<uint8_t> with(std::vector<uint8_t> bytes, size_t offset, T value) {
  std::memcpy(bytes.data() + offset, &value, sizeof(T));
  return bytes;
}

/// `frame` with the content of its section of triangles replaced.
std::vector<uint8_t> with_triangles(const CompactFrame& frame, std::vector<uint8_t> content) {
  auto bytes = encode_compact(frame);
  uint32_t old_size = 0;
  std::memcpy(&old_size, bytes.data() + 84, 4);
  bytes.erase(bytes.end() - old_size, bytes.end());
  std::vector<uint8_t> section(ZSTD_compressBound(content.size()));
  const std::unique_ptr<ZSTD_CCtx, size_t (*)(ZSTD_CCtx*)> context(ZSTD_createCCtx(),
                                                                   ZSTD_freeCCtx);
  ZSTD_CCtx_setParameter(context.get(), ZSTD_c_checksumFlag, 1);
  section.resize(ZSTD_compress2(context.get(), section.data(), section.size(), content.data(),
                                content.size()));
  bytes.insert(bytes.end(), section.begin(), section.end());
  return with<uint32_t>(bytes, 84, static_cast<uint32_t>(section.size()));
}

TEST(CompactFrame, with_a_wrong_field_in_its_header_gives_nothing) {
  const auto bytes = encode_compact(small_frame());
  EXPECT_FALSE(decode_compact(with<uint8_t>(bytes, 0, 'W')));
  EXPECT_FALSE(decode_compact(with<uint16_t>(bytes, 8, 2)));        // version
  EXPECT_FALSE(decode_compact(with<uint16_t>(bytes, 10, 0)));       // colours there, flag not
  EXPECT_FALSE(decode_compact(with<uint16_t>(bytes, 10, 3)));       // unknown flag
  EXPECT_FALSE(decode_compact(with<uint16_t>(bytes, 12, 1)));       // a name too many
  EXPECT_FALSE(decode_compact(with<uint16_t>(bytes, 12, 3)));       // a name too few
  EXPECT_FALSE(decode_compact(with<uint16_t>(bytes, 14, 257)));     // missing cameras
  EXPECT_FALSE(decode_compact(with<int64_t>(bytes, 16, -1)));       // pulse
  EXPECT_FALSE(decode_compact(with<double>(bytes, 32, NAN)));       // origin
  EXPECT_FALSE(decode_compact(with<double>(bytes, 56, 0.0)));       // step
  EXPECT_FALSE(decode_compact(with<double>(bytes, 56, INFINITY)));  // step
  EXPECT_FALSE(decode_compact(with<uint32_t>(bytes, 64, 9)));       // vertices
  EXPECT_FALSE(decode_compact(with<uint32_t>(bytes, 64, (1U << 22) + 1)));
  EXPECT_FALSE(decode_compact(with<uint32_t>(bytes, 68, 11)));  // triangles
  EXPECT_FALSE(decode_compact(with<uint32_t>(bytes, 72, 0xFFFFFFFF)));
}

TEST(CompactFrame, with_more_content_than_its_counts_say_gives_nothing) {
  CompactFrame frame = small_frame();
  frame.mesh.triangles.clear();
  const auto bytes = encode_compact(frame);
  ASSERT_TRUE(decode_compact(bytes));
  EXPECT_FALSE(decode_compact(with<uint32_t>(bytes, 64, 7)));
  EXPECT_FALSE(decode_compact(with<uint32_t>(bytes, 64, 0)));
  // A few bytes that unpack to sixteen million: refused for what they state, before they are
  // unpacked.
  EXPECT_FALSE(decode_compact(with_triangles(frame, std::vector<uint8_t>(1 << 24))));
}

TEST(CompactFrame, with_names_out_of_order_empty_or_too_long_gives_nothing) {
  const auto bytes = encode_compact(small_frame());
  EXPECT_FALSE(decode_compact(with<uint8_t>(bytes, 88 + 5, '3')));  // cam03 before cam02
  EXPECT_FALSE(decode_compact(with<uint8_t>(bytes, 88, 0)));
  EXPECT_FALSE(decode_compact(with<uint8_t>(bytes, 88, 65)));
}

TEST(CompactFrame, with_wrong_triangle_codes_gives_nothing) {
  CompactFrame frame = small_frame();
  frame.mesh.triangles = {{0, 1, 2}, {1, 2, 3}};
  const std::vector<uint8_t> right{0, 0, 0, 2, 1, 0};
  ASSERT_TRUE(decode_compact(with_triangles(frame, right)));
  EXPECT_EQ(with_triangles(frame, right), encode_compact(frame));
  EXPECT_FALSE(decode_compact(with_triangles(frame, {0, 0, 0, 4, 1, 0})));     // before the first
  EXPECT_FALSE(decode_compact(with_triangles(frame, {0, 0, 0, 2, 1})));        // too few
  EXPECT_FALSE(decode_compact(with_triangles(frame, {0, 0, 0, 2, 1, 0, 0})));  // too many
  EXPECT_FALSE(decode_compact(with_triangles(frame, {0, 0, 0, 2, 1, 0x80})));  // unfinished
  EXPECT_FALSE(decode_compact(with_triangles(frame, {0, 0, 0, 2, 0x81, 0, 0})));  // overlong
  EXPECT_FALSE(decode_compact(with_triangles(frame, {0, 0, 0, 2, 0x81, 0x80, 0x80, 0x80, 0, 0})));
  frame.mesh.triangles.assign(3, {0, 1, 2});  // nine new vertices of eight
  EXPECT_FALSE(decode_compact(with_triangles(frame, {0, 0, 0, 0, 0, 0, 0, 0, 0})));
}

TEST(CompactFrame, of_nothing_is_a_frame_too) {
  CompactFrame empty;
  empty.lattice.step = 0.005;
  const auto back = decode_compact(encode_compact(empty));
  ASSERT_TRUE(back);
  EXPECT_TRUE(back->mesh.vertices.empty() && back->mesh.triangles.empty() && back->cameras.empty());
}

TEST(CompactFrame, beyond_its_limits_is_refused_with_the_reason) {
  CompactFrame outside = small_frame();
  outside.mesh.vertices[3].x() = -1.1F;
  EXPECT_THROW(encode_compact(outside), InputError);
  CompactFrame not_a_number = small_frame();
  not_a_number.mesh.vertices[3].x() = NAN;
  EXPECT_THROW(encode_compact(not_a_number), InputError);
  CompactFrame many = small_frame();
  many.cameras.assign(257, "cam");
  EXPECT_THROW(encode_compact(many), InputError);
  CompactFrame named = small_frame();
  named.cameras = {std::string(65, 'x')};
  EXPECT_THROW(encode_compact(named), InputError);
}

TEST(CompactFrame, rounds_vertices_off_the_lattice_to_the_nearest_point) {
  CompactFrame frame = small_frame();
  frame.mesh.vertices[0] += Eigen::Vector3f(0.002F, -0.002F, 0.0024F);
  const auto back = decode_compact(encode_compact(frame));
  ASSERT_TRUE(back);
  EXPECT_LT((back->mesh.vertices[0] - small_frame().mesh.vertices[0]).norm(), 1e-6F);
}

TEST(CompactFrame, header_has_the_bytes_that_the_page_says) {
  const auto bytes = encode_compact(small_frame());
  const std::vector<uint8_t> start{'V', '3', 'D', 'F', 13, 10, 26, 10, 1, 0, 1, 0,
                                   2,   0,   0,   0,   7,  0,  0,  0,  0, 0, 0, 0};
  EXPECT_TRUE(std::equal(start.begin(), start.end(), bytes.begin()));
  const std::string names(bytes.begin() + 88, bytes.begin() + 100);
  EXPECT_EQ(names, std::string("\5cam01\5cam02"));
}

}  // namespace
}  // namespace v3d
