#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <cstring>

#include "daemon/control/clock_monitor.h"
#include "support/temporary_folder.h"

namespace v3d::control {
namespace {

std::vector<uint8_t> bytes_of(const std::string& hex) {
  std::vector<uint8_t> bytes;
  for (size_t i = 0; i < hex.size(); i += 2) {
    bytes.push_back(static_cast<uint8_t>(std::stoi(hex.substr(i, 2), nullptr, 16)));
  }
  return bytes;
}

/// Replies of ptp4l 3.1.1 to request 9, as received: of a follower, whose offset pmc showed as 259
/// ns, and of the master.
std::vector<uint8_t> reply_of_a_follower() {
  return bytes_of(
      "0d02004800000000000000000000000000000000e26a63fffe8fd6c900000009047f0000000000000000004d0000"
      "020000010014200100010000000001030000000000000a100000");
}
std::vector<uint8_t> reply_of_the_master() {
  return bytes_of(
      "0d020048000000000000000000000000000000002a96bbfffed5259100000009047f0000000000000000004d0000"
      "0200000100142001000000000000000000000000000000000000");
}

TEST(PtpMonitor, parses_replies_of_ptp4l) {
  const auto follower = parse_ptp_reply(reply_of_a_follower(), 9);
  ASSERT_TRUE(follower);
  EXPECT_EQ(follower->steps_removed, 1);
  EXPECT_NEAR(follower->offset_s, 259e-9, 1e-12);
  const auto master = parse_ptp_reply(reply_of_the_master(), 9);
  ASSERT_TRUE(master);
  EXPECT_EQ(master->steps_removed, 0);
  auto behind = reply_of_a_follower();
  for (size_t i = 56; i < 64; ++i) behind[i] = static_cast<uint8_t>(~behind[i]);
  EXPECT_NEAR(parse_ptp_reply(behind, 9)->offset_s, -259e-9, 1e-12);
}

TEST(PtpMonitor, accepts_only_the_reply_to_its_request) {
  EXPECT_FALSE(parse_ptp_reply(reply_of_a_follower(), 10));
  EXPECT_FALSE(parse_ptp_reply({}, 9));
  EXPECT_FALSE(parse_ptp_reply(ptp_request(9), 9)) << "the request itself";
  const auto reply = reply_of_a_follower();
  for (size_t size = 0; size < reply.size(); ++size) {
    EXPECT_FALSE(parse_ptp_reply(std::span(reply).first(size), 9));
  }
}

/// ptp4l's socket.
class FakePtp4l {
 public:
  explicit FakePtp4l(const std::filesystem::path& path)
      : fd_(socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0)) {
    sockaddr_un here{};
    here.sun_family = AF_UNIX;
    std::strncpy(here.sun_path, path.c_str(), sizeof here.sun_path - 1);
    EXPECT_EQ(bind(fd_, reinterpret_cast<const sockaddr*>(&here), sizeof here), 0);
  }
  ~FakePtp4l() { close(fd_); }

  void answer(std::vector<uint8_t> reply) {
    uint8_t question[512];
    sockaddr_un from{};
    socklen_t size = sizeof from;
    ASSERT_EQ(
        recvfrom(fd_, question, sizeof question, 0, reinterpret_cast<sockaddr*>(&from), &size), 54);
    std::copy(question + 30, question + 32, reply.begin() + 30);
    sendto(fd_, reply.data(), reply.size(), 0, reinterpret_cast<const sockaddr*>(&from), size);
  }

 private:
  int fd_;
};

std::map<std::string, double> report(PtpMonitor& monitor) {
  std::map<std::string, double> values;
  monitor.report(values);
  return values;
}

TEST(PtpMonitor, reports_the_last_reply_until_ptp4l_is_silent_for_three_requests) {
  const test::TemporaryFolder root;
  std::filesystem::create_directories(root / "run");
  FakePtp4l ptp4l(root / "run/ptp4l");
  PtpMonitor monitor(root.path());
  ptp4l.answer(reply_of_a_follower());
  auto values = report(monitor);
  EXPECT_EQ(values.at("ptp_steps_removed"), 1);
  EXPECT_NEAR(values.at("ptp_offset_us"), 0.259, 1e-6);
  ptp4l.answer(reply_of_the_master());
  values = report(monitor);
  EXPECT_EQ(values.at("ptp_steps_removed"), 0);
  EXPECT_FALSE(values.contains("ptp_offset_us"));
  EXPECT_FALSE(report(monitor).empty()) << "one answer may be late";
  report(monitor);
  EXPECT_TRUE(report(monitor).empty()) << "unknown";
}

TEST(PtpMonitor, reports_nothing_without_ptp4l) {
  const test::TemporaryFolder root;
  PtpMonitor monitor(root.path());
  EXPECT_TRUE(report(monitor).empty());
}

}  // namespace
}  // namespace v3d::control
