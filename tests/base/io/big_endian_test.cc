#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <array>

#include "base/core/bytes.h"

namespace v3d {
namespace {

using Bytes = std::vector<uint8_t>;

TEST(BigEndian, writes_the_most_significant_byte_first) {
  constexpr std::array<uint8_t, 4> kBytes{0xed, 0xa1, 0xda, 0x01};
  static_assert(read_big_endian(kBytes) == 0xeda1da01);
  Bytes written(4);
  write_big_endian(0xeda1da01, written);
  EXPECT_EQ(written, Bytes(kBytes.begin(), kBytes.end()));
}

TEST(BigEndian, reads_no_bytes_as_zero) { EXPECT_EQ(read_big_endian({}), 0u); }

TEST(BigEndian, put_appends_to_existing_bytes) {
  Bytes bytes{7};
  put_big_endian(bytes, 0x0102, 3);
  put_big_endian(bytes, 0xffu, 1);
  EXPECT_EQ(bytes, (Bytes{7, 0, 1, 2, 0xff}));
}

RC_GTEST_PROP(BigEndian, reads_what_was_written_up_to_its_size, (uint64_t value)) {
  const auto size = *rc::gen::inRange<size_t>(0, 9);
  const uint64_t mask = size == 8 ? ~uint64_t{0} : (uint64_t{1} << 8 * size) - 1;
  Bytes appended;
  put_big_endian(appended, value, size);
  Bytes written(size);
  write_big_endian(value, written);
  RC_ASSERT(appended == written);
  RC_ASSERT(read_big_endian(written) == (value & mask));
}

}  // namespace
}  // namespace v3d
