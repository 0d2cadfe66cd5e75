#include "daemon/control/clock_monitor.h"

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <unistd.h>

#include <random>

#include "support/temporary_folder.h"

namespace v3d::control {
namespace {

/// The reply of chronyd 4.3 to request 7, as received: local clock, stratum 3.
std::vector<uint8_t> recorded_reply() {
  const std::string hex =
      "060200000021000500000000000000000000000700000000000000007f7f010100000000000000000000000000"
      "0000000000000000030000000000006b012cfc2c4a4d0b0000000000000000000000000000000000000000000000"
      "00000000000000000000000000";
  std::vector<uint8_t> bytes;
  for (size_t i = 0; i < hex.size(); i += 2) {
    bytes.push_back(static_cast<uint8_t>(std::stoi(hex.substr(i, 2), nullptr, 16)));
  }
  return bytes;
}

/// chrony's number coefficient * 2^(exponent - 25), written at `at`.
void put_real(std::vector<uint8_t>& reply, size_t at, int exponent, int32_t coefficient) {
  const uint32_t word =
      static_cast<uint32_t>(exponent) << 25 | (static_cast<uint32_t>(coefficient) & 0x1ffffff);
  for (size_t i = 0; i < 4; ++i) reply[at + i] = static_cast<uint8_t>(word >> (24 - 8 * i));
}

TEST(ClockMonitor, parses_a_reply_of_chronyd) {
  const auto tracking = parse_tracking(recorded_reply(), 7);
  ASSERT_TRUE(tracking);
  EXPECT_TRUE(tracking->synchronised);
  EXPECT_EQ(tracking->offset_s, 0);
}

TEST(ClockMonitor, distinguishes_a_fast_clock_from_a_slow_one) {
  auto reply = recorded_reply();
  put_real(reply, 68, 0, 1 << 23);  // chronyd will add a quarter of a second
  put_real(reply, 92, 0, 1 << 23);  // round trip to the server
  EXPECT_DOUBLE_EQ(parse_tracking(reply, 7)->offset_s, -0.25);
  EXPECT_DOUBLE_EQ(parse_tracking(reply, 7)->error_bound_s, 0.375);
  put_real(reply, 68, -1, -(1 << 23));
  EXPECT_DOUBLE_EQ(parse_tracking(reply, 7)->offset_s, 0.125);
}

TEST(ClockMonitor, reports_an_unsynchronised_clock) {
  auto reply = recorded_reply();
  reply[55] = 3;
  EXPECT_FALSE(parse_tracking(reply, 7)->synchronised);
}

TEST(ClockMonitor, accepts_only_the_reply_to_its_request) {
  EXPECT_FALSE(parse_tracking(recorded_reply(), 8));
  EXPECT_FALSE(parse_tracking({}, 7));
  EXPECT_FALSE(parse_tracking(tracking_request(7), 7)) << "the request itself";
  auto reply = recorded_reply();
  reply.push_back(0);
  EXPECT_FALSE(parse_tracking(reply, 7));
  reply = recorded_reply();
  reply[9] = 1;  // an error status
  EXPECT_FALSE(parse_tracking(reply, 7));
}

/// Answers one request at a time, like chronyd.
class FakeChronyd {
 public:
  FakeChronyd() : fd_(socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0)) {
    sockaddr_in here{};
    here.sin_family = AF_INET;
    here.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    bind(fd_, reinterpret_cast<const sockaddr*>(&here), sizeof here);
    socklen_t size = sizeof here;
    getsockname(fd_, reinterpret_cast<sockaddr*>(&here), &size);
    port_ = ntohs(here.sin_port);
  }
  ~FakeChronyd() { close(fd_); }
  uint16_t port() const { return port_; }

  void answer(std::vector<uint8_t> reply) {
    uint8_t question[512];
    sockaddr_in from{};
    socklen_t size = sizeof from;
    ASSERT_EQ(
        recvfrom(fd_, question, sizeof question, 0, reinterpret_cast<sockaddr*>(&from), &size),
        104);
    std::copy(question + 8, question + 12, reply.begin() + 16);
    sendto(fd_, reply.data(), reply.size(), 0, reinterpret_cast<const sockaddr*>(&from), size);
  }

 private:
  int fd_;
  uint16_t port_ = 0;
};

std::map<std::string, double> report(ClockMonitor& monitor) {
  std::map<std::string, double> values;
  monitor.report(values);
  return values;
}

TEST(ClockMonitor, reports_the_last_reply_until_chronyd_is_silent_for_three_requests) {
  const test::TemporaryFolder no_timesyncd;
  FakeChronyd chronyd;
  ClockMonitor monitor(chronyd.port(), no_timesyncd.path());
  auto reply = recorded_reply();
  put_real(reply, 68, -10, 1 << 23);
  chronyd.answer(reply);
  auto values = report(monitor);
  EXPECT_EQ(values.at("clock_synchronised_flag"), 1);
  EXPECT_NEAR(values.at("clock_offset_us"), -244.14, 0.01);
  EXPECT_TRUE(report(monitor).contains("clock_offset_us")) << "one answer may be late";
  report(monitor);
  EXPECT_TRUE(report(monitor).empty()) << "unknown";
}

TEST(ClockMonitor, reports_synchronisation_by_timesyncd_without_chronyd) {
  const test::TemporaryFolder root;
  std::filesystem::create_directories(root / "run/systemd/timesync");
  test::write_text(root / "run/systemd/timesync/synchronized", "");
  ClockMonitor monitor(9, root.path());  // the discard port, which nothing listens on
  const auto values = report(monitor);
  EXPECT_EQ(values.at("clock_synchronised_flag"), 1);
  EXPECT_FALSE(values.contains("clock_offset_us"));
}

}  // namespace
}  // namespace v3d::control
