#include <gtest/gtest.h>

#include "base/config/studio_values.h"

namespace v3d {
namespace {

TEST(LcmGroup, reads_address_and_port_of_the_url) {
  EXPECT_EQ(lcm_group("udpm://239.255.76.68:7668?ttl=1&recv_buf_size=16777216"),
            (LcmGroup{"239.255.76.68", 7668}));
  EXPECT_EQ(lcm_group("udpm://224.0.0.5:1"), (LcmGroup{"224.0.0.5", 1}));
}

TEST(LcmGroup, uses_the_defaults_of_lcm_for_omitted_parts) {
  EXPECT_EQ(lcm_group("udpm://"), LcmGroup{});
  EXPECT_EQ(lcm_group("udpm://?ttl=1"), LcmGroup{});
  EXPECT_EQ(lcm_group("udpm://239.1.2.3"), (LcmGroup{"239.1.2.3", 7667}));
  EXPECT_EQ(lcm_group("udpm://:7001"), (LcmGroup{"239.255.76.67", 7001}));
}

TEST(LcmGroup, is_empty_for_a_url_without_a_multicast_group) {
  for (const char* url : {"", "memq://", "file:///tmp/log", "udpm://10.0.0.1:7667",
                          "udpm://studio:7667", "udpm://239.1.2.3:0", "udpm://239.1.2.3:65536",
                          "udpm://239.1.2.3:", "udpm://239.1.2.3:x", "udpm://239.1.2.3:7667x"}) {
    EXPECT_FALSE(lcm_group(url)) << url;
  }
}

TEST(LcmOptions, are_read_in_any_order) {
  EXPECT_EQ(lcm_options("udpm://239.255.76.67:7667?ttl=1&recv_buf_size=16777216"),
            (LcmOptions{1, 16'777'216}));
  EXPECT_EQ(lcm_options("udpm://?recv_buf_size=4096&transmit_only=true&ttl=2"),
            (LcmOptions{2, 4096}));
  EXPECT_EQ(lcm_options("udpm://239.255.76.67:7667"), LcmOptions{});
  EXPECT_EQ(lcm_options("udpm://?"), LcmOptions{});
}

TEST(LcmOptions, are_empty_for_invalid_and_out_of_range_numbers) {
  for (const char* url :
       {"udpm://?ttl=", "udpm://?ttl", "udpm://?ttl=256", "udpm://?ttl=-1", "udpm://?ttl=1x",
        "udpm://?recv_buf_size=9999999999", "udpm://?ttl=1&recv_buf_size=much"}) {
    EXPECT_FALSE(lcm_options(url)) << url;
  }
}

}  // namespace
}  // namespace v3d
