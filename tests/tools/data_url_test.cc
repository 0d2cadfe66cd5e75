#include "common/data_url.h"

#include <gtest/gtest.h>

#include <vector>

namespace v3d {
namespace {

TEST(DataUrl, encodes_by_base64_with_padding) {
  // RFC 4648, section 10: "f", "fo", "foo".
  EXPECT_EQ(base64(std::vector<uint8_t>{'f', 'o'}), "Zm8=");
  EXPECT_EQ(data_url({}), "data:image/jpeg;base64,");
  EXPECT_EQ(data_url(std::vector<uint8_t>{'f'}), "data:image/jpeg;base64,Zg==");
  EXPECT_EQ(data_url(std::vector<uint8_t>{'f', 'o'}), "data:image/jpeg;base64,Zm8=");
  EXPECT_EQ(data_url(std::vector<uint8_t>{'f', 'o', 'o'}), "data:image/jpeg;base64,Zm9v");
  EXPECT_EQ(data_url(std::vector<uint8_t>{0xFB, 0xFF, 0xBF}), "data:image/jpeg;base64,+/+/");
}

}  // namespace
}  // namespace v3d
