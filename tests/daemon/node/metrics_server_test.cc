#include "daemon/node/metrics_server.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "base/core/error.h"
#include "base/io/unique_fd.h"
#include "support/loopback_connection.h"

namespace v3d::node {
namespace {

using testing::HasSubstr;
using testing::Not;

/// A TCP connection to that port that has sent `bytes`; closed with the object.
class Client {
 public:
  Client(int port, const std::string& bytes) : fd_(connect_to_loopback(port, bytes)) {}
  /// All bytes until the server ends the connection, or sends none for 30 s.
  std::string read_all() const { return read_until_end(fd_); }

 private:
  io::UniqueFd fd_;
};

/// The response to HTTP GET /metrics.
std::string get(int port) { return Client(port, "GET /metrics HTTP/1.0\r\n\r\n").read_all(); }

wire::HealthMessage health() {
  wire::HealthMessage message;
  message.node = "cap01";
  message.program = "v3d-captured";
  message.version = "0.1.0";
  message.state = wire::NodeState::kRecording;
  message.take = "kendo-07";
  message.texts = {{"cam03.firmware", "1.2"}, {"cam03.model", "Maker \"A\""}};
  message.values = {{"disk_free_bytes", 812e9}, {"cam03.frames_missing", 7}, {"odd-name", 1}};
  return message;
}

TEST(MetricsServer, serves_the_last_health_with_node_and_camera_as_labels) {
  MetricsServer server("127.0.0.1:0");
  const int port = server.port();
  EXPECT_THAT(get(port), HasSubstr("200 OK")) << "before the first health";
  server.update(health());
  const std::string text = get(port);
  EXPECT_THAT(text, HasSubstr("v3d_disk_free_bytes{node=\"cap01\"} 812000000000"));
  EXPECT_THAT(text, HasSubstr("v3d_camera_frames_missing{node=\"cap01\",camera=\"cam03\"} 7"));
  EXPECT_THAT(text, HasSubstr("v3d_odd_name{"));
  EXPECT_THAT(text, HasSubstr("v3d_camera_info{node=\"cap01\",camera=\"cam03\",firmware=\"1.2\","
                              "model=\"Maker \\\"A\\\"\"} 1"));
  EXPECT_THAT(text, HasSubstr("state=\"recording\",take=\"kendo-07\""));
  wire::HealthMessage later = health();
  later.values = {{"disk_free_bytes", 811e9}};
  server.update(later);
  EXPECT_THAT(get(port), HasSubstr("} 811000000000"));
  EXPECT_THAT(get(port), Not(HasSubstr("frames_missing")));
}

TEST(MetricsServer, labels_values_with_a_camera_with_a_dot_in_its_name) {
  MetricsServer server("127.0.0.1:0");
  wire::HealthMessage message = health();
  message.values = {{"left.1.frames_missing", 7}};
  server.update(message);
  EXPECT_THAT(get(server.port()),
              HasSubstr("v3d_camera_frames_missing{node=\"cap01\",camera=\"left.1\"} 7"));
}

TEST(MetricsServer, answers_while_a_client_never_completes_its_request) {
  MetricsServer server("127.0.0.1:0");
  for (const std::string half : {"", "GET /metrics HTTP/1.0\r\nX: "}) {
    const Client stalled(server.port(), half);
    EXPECT_THAT(get(server.port()), HasSubstr("200 OK")) << "with '" << half << "' stalled";
  }
}

/// The attacker keeps its last 200 connections open. It begins several between two scrapes, so more
/// than 200 a second whatever the speed of the machine.
TEST(MetricsServer, answers_each_scrape_while_half_open_requests_never_stop) {
  MetricsServer server("127.0.0.1:0");
  server.update(health());
  std::vector<std::unique_ptr<Client>> stalled(200);
  for (size_t i = 0; i < 1000; ++i) {
    stalled[i % stalled.size()] = std::make_unique<Client>(server.port(), "GET /me");
    if (i % 4 == 3) {
      ASSERT_THAT(get(server.port()), HasSubstr("v3d_disk_free_bytes")) << i;
    }
  }
}

TEST(MetricsServer, ends_each_connection_after_its_answer) {
  MetricsServer server("127.0.0.1:0");
  const Client scraper(server.port(), "GET /metrics HTTP/1.1\r\nHost: cap01\r\n\r\n");
  EXPECT_THAT(scraper.read_all(), HasSubstr("Connection: close"));
}

TEST(MetricsServer, serves_nothing_else) {
  MetricsServer server("127.0.0.1:0");
  for (const char* request : {"GET / HTTP/1.0", "POST /metrics HTTP/1.0"}) {
    const Client other(server.port(), std::string(request) + "\r\n\r\n");
    EXPECT_THAT(other.read_all(), HasSubstr("404 Not Found")) << request;
  }
}

TEST(MetricsServer, throws_for_an_address_where_it_cannot_listen) {
  const MetricsServer other("127.0.0.1:0");
  const std::string in_use = "127.0.0.1:" + std::to_string(other.port());
  EXPECT_THROW(MetricsServer{in_use}, std::runtime_error);
  EXPECT_THROW(MetricsServer("9464"), InputError);
}

TEST(MetricsServer, is_off_by_default_and_optional) {
  EXPECT_EQ(serve_metrics(""), nullptr);
  const MetricsServer other("127.0.0.1:0");
  EXPECT_EQ(serve_metrics("127.0.0.1:" + std::to_string(other.port())), nullptr) << "in use";
}

}  // namespace
}  // namespace v3d::node
