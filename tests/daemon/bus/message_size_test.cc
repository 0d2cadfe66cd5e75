#include <gtest/gtest.h>

#include "daemon/bus/channel_list.h"

namespace v3d::bus {
namespace {

TEST(ShortenedText, is_the_text_where_it_fits_and_else_its_beginning_of_whole_characters) {
  EXPECT_EQ(shortened("12345678", 8), "12345678");
  EXPECT_EQ(shortened("123456789", 8), "1234 ...");
  EXPECT_EQ(shortened("123\u00e9\u00e9\u00e9", 8), "123 ...") << "the two bytes of a character";
  EXPECT_EQ(shortened("\u00e9\u00e9\u00e9", 4), " ...");
}

TEST(MessageSize, leaves_room_for_what_the_sender_adds) {
  EXPECT_EQ(max_encoded_bytes("V3D_EVENT", true), 32U * 1024 - 32 - 76);
  EXPECT_EQ(max_encoded_bytes("V3D_FRAME_cam01", true), (16U << 20) - 32) << "without a signature";
  EXPECT_EQ(max_encoded_bytes("V3D_HEALTH_cap01", false), kMaxUnverifiedHealth);
  EXPECT_LT(max_encoded_bytes("another", true), size_t{16} << 20);
}

}  // namespace
}  // namespace v3d::bus
