// The metrics server on an address that this PC gets after the server has started, in a private
// network.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <memory>
#include <string>

#include "base/io/unique_fd.h"
#include "daemon/node/metrics_server.h"
#include "support/loopback_connection.h"

namespace v3d::node {
namespace {

using testing::HasSubstr;

constexpr char kAddress[] = "198.51.100.1";  // of a network for examples

TEST(MetricsServer, answers_on_its_address_once_an_interface_has_it) {
  const std::unique_ptr<MetricsServer> server = serve_metrics(std::string(kAddress) + ":0");
  ASSERT_NE(server, nullptr);
  wire::HealthMessage health;
  health.node = "cap01";
  server->update(health);
  ASSERT_EQ(std::system((std::string("ip addr add ") + kAddress + "/32 dev lo").c_str()), 0);
  const io::UniqueFd client = connect_to(kAddress, server->port(), "GET /metrics HTTP/1.0\r\n\r\n");
  EXPECT_THAT(read_until_end(client), HasSubstr("v3d_info{node=\"cap01\""));
}

}  // namespace
}  // namespace v3d::node
