#include "daemon/control/clock_monitor.h"

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <unistd.h>

#include <random>

#include "support/temporary_folder.h"

namespace v3d {
namespace {

/// The reply of chronyd 4.3 to request 7, as it came over the wire: its own clock, stratum 3.
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

TEST(ClockMonitor, understands_a_reply_of_chronyd) {
  const auto tracking = parse_tracking(recorded_reply(), 7);
  ASSERT_TRUE(tracking);
  EXPECT_TRUE(tracking->synchronised);
  EXPECT_EQ(tracking->offset_s, 0);
}

TEST(ClockMonitor, tells_a_clock_that_is_ahead_from_one_that_is_behind) {
  auto reply = recorded_reply();
  put_real(reply, 68, 0, 1 << 23);  // chronyd will add a quarter of a second
  put_real(reply, 92, 0, 1 << 23);  // the way to the server and back
  EXPECT_DOUBLE_EQ(parse_tracking(reply, 7)->offset_s, -0.25);
  EXPECT_DOUBLE_EQ(parse_tracking(reply, 7)->error_bound_s, 0.375);
  put_real(reply, 68, -1, -(1 << 23));
  EXPECT_DOUBLE_EQ(parse_tracking(reply, 7)->offset_s, 0.125);
}

TEST(ClockMonitor, knows_that_chronyd_has_not_found_the_time_yet) {
  auto reply = recorded_reply();
  reply[55] = 3;
  EXPECT_FALSE(parse_tracking(reply, 7)->synchronised);
}

TEST(ClockMonitor, believes_no_reply_but_the_one_to_its_request) {
  EXPECT_FALSE(parse_tracking(recorded_reply(), 8));
  EXPECT_FALSE(parse_tracking({}, 7));
  EXPECT_FALSE(parse_tracking(tracking_request(7), 7)) << "our own question, sent back";
  auto reply = recorded_reply();
  reply.push_back(0);
  EXPECT_FALSE(parse_tracking(reply, 7));
  reply = recorded_reply();
  reply[9] = 1;  // a status that is no success
  EXPECT_FALSE(parse_tracking(reply, 7));
}

/// Answers one question at a time, as chronyd does.
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

std::map<std::string, double> report(ClockMonitor& watch) {
  std::map<std::string, double> values;
  watch.report(values);
  return values;
}

TEST(ClockMonitor, tells_what_chronyd_said_until_it_has_been_silent_for_long) {
  const test::TemporaryFolder no_timesyncd;
  FakeChronyd chronyd;
  ClockMonitor watch(chronyd.port(), no_timesyncd.path());
  auto reply = recorded_reply();
  put_real(reply, 68, -10, 1 << 23);
  chronyd.answer(reply);
  auto values = report(watch);
  EXPECT_EQ(values.at("clock_synchronised_flag"), 1);
  EXPECT_NEAR(values.at("clock_offset_us"), -244.14, 0.01);
  EXPECT_TRUE(report(watch).contains("clock_offset_us")) << "one answer may be late";
  report(watch);
  EXPECT_TRUE(report(watch).empty()) << "unknown";
}

TEST(ClockMonitor, finds_the_mark_of_timesyncd_where_there_is_no_chronyd) {
  const test::TemporaryFolder root;
  std::filesystem::create_directories(root / "run/systemd/timesync");
  test::write_text(root / "run/systemd/timesync/synchronized", "");
  ClockMonitor watch(9, root.path());  // "discard": nobody is there
  const auto values = report(watch);
  EXPECT_EQ(values.at("clock_synchronised_flag"), 1);
  EXPECT_FALSE(values.contains("clock_offset_us"));
}

}  // namespace
}  // namespace v3d
