#include "daemon/metrics_server.h"

#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <unistd.h>

#include "base/error.h"

namespace v3d {
namespace {

using testing::HasSubstr;
using testing::Not;

/// A port that was free a moment ago.
int free_port() {
  const int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in here{};
  here.sin_family = AF_INET;
  here.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  bind(fd, reinterpret_cast<const sockaddr*>(&here), sizeof here);
  socklen_t size = sizeof here;
  getsockname(fd, reinterpret_cast<sockaddr*>(&here), &size);
  close(fd);
  return ntohs(here.sin_port);
}

/// What HTTP GET /metrics gives.
std::string get(int port) {
  const int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in there{};
  there.sin_family = AF_INET;
  there.sin_port = htons(static_cast<uint16_t>(port));
  there.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  std::string text;
  if (connect(fd, reinterpret_cast<const sockaddr*>(&there), sizeof there) == 0) {
    const std::string request = "GET /metrics HTTP/1.0\r\n\r\n";
    send(fd, request.data(), request.size(), 0);
    char part[4096];
    for (ssize_t n = 0; (n = recv(fd, part, sizeof part, 0)) > 0;) {
      text.append(part, static_cast<size_t>(n));
    }
  }
  close(fd);
  return text;
}

HealthMessage health() {
  HealthMessage message;
  message.node = "cap01";
  message.program = "v3d-captured";
  message.version = "0.1.0";
  message.state = NodeState::kRecording;
  message.take = "kendo-07";
  message.values = {{"disk_free_bytes", 812e9}, {"cam03.frames_missing", 7}, {"odd-name", 1}};
  return message;
}

TEST(MetricsServer, tells_the_last_health_with_node_and_camera_as_labels) {
  const int port = free_port();
  MetricsServer server("127.0.0.1:" + std::to_string(port));
  EXPECT_THAT(get(port), HasSubstr("200 OK")) << "before the first health";
  server.update(health());
  const std::string text = get(port);
  EXPECT_THAT(text, HasSubstr("v3d_disk_free_bytes{node=\"cap01\"} 812000000000"));
  EXPECT_THAT(text, HasSubstr("v3d_camera_frames_missing{node=\"cap01\",camera=\"cam03\"} 7"));
  EXPECT_THAT(text, HasSubstr("v3d_odd_name{"));
  EXPECT_THAT(text, HasSubstr("state=\"recording\",take=\"kendo-07\""));
  HealthMessage later = health();
  later.values = {{"disk_free_bytes", 811e9}};
  server.update(later);
  EXPECT_THAT(get(port), HasSubstr("} 811000000000"));
  EXPECT_THAT(get(port), Not(HasSubstr("frames_missing")));
}

TEST(MetricsServer, names_an_address_where_it_cannot_listen) {
  EXPECT_THROW(MetricsServer("198.51.100.1:9464"), InputError) << "of a network for examples";
}

TEST(MetricsServer, is_off_by_default_and_never_in_the_way) {
  EXPECT_EQ(serve_metrics(""), nullptr);
  EXPECT_EQ(serve_metrics("198.51.100.1:9464"), nullptr);
}

}  // namespace
}  // namespace v3d
