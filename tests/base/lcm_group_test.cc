#include "base/lcm_group.h"

#include <gtest/gtest.h>

namespace v3d {
namespace {

TEST(LcmGroup, is_address_and_port_of_the_url) {
  EXPECT_EQ(lcm_group("udpm://239.255.76.68:7668?ttl=1&recv_buf_size=16777216"),
            (LcmGroup{"239.255.76.68", 7668}));
  EXPECT_EQ(lcm_group("udpm://224.0.0.5:1"), (LcmGroup{"224.0.0.5", 1}));
}

TEST(LcmGroup, is_that_of_LCM_where_the_url_leaves_something_out) {
  EXPECT_EQ(lcm_group("udpm://"), LcmGroup{});
  EXPECT_EQ(lcm_group("udpm://?ttl=1"), LcmGroup{});
  EXPECT_EQ(lcm_group("udpm://239.1.2.3"), (LcmGroup{"239.1.2.3", 7667}));
  EXPECT_EQ(lcm_group("udpm://:7001"), (LcmGroup{"239.255.76.67", 7001}));
}

TEST(LcmGroup, is_none_where_the_url_names_none) {
  for (const char* url : {"", "memq://", "file:///tmp/log", "udpm://10.0.0.1:7667",
                          "udpm://studio:7667", "udpm://239.1.2.3:0", "udpm://239.1.2.3:65536",
                          "udpm://239.1.2.3:", "udpm://239.1.2.3:x", "udpm://239.1.2.3:7667x"}) {
    EXPECT_FALSE(lcm_group(url)) << url;
  }
}

}  // namespace
}  // namespace v3d
