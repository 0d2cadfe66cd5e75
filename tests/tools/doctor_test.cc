#include "v3dctl/doctor.h"

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <unistd.h>

#include <thread>

namespace v3d::ctl {
namespace {

using Verdict = Finding::Verdict;

TEST(Doctor, wants_a_receive_buffer_that_holds_a_burst_of_frames) {
  EXPECT_EQ(check_receive_buffer(212992).verdict, Verdict::kBad);
  EXPECT_NE(check_receive_buffer(212992).remedy.find("sysctl"), std::string::npos);
  EXPECT_EQ(check_receive_buffer(33554432).verdict, Verdict::kGood);
  EXPECT_EQ(check_receive_buffer(-1).verdict, Verdict::kUnknown);
}

TEST(Doctor, names_a_folder_of_takes_that_is_not_there) {
  const Finding finding = check_disk("/not/there");
  EXPECT_EQ(finding.verdict, Verdict::kBad);
  EXPECT_NE(finding.text.find("/not/there"), std::string::npos);
}

TEST(Doctor, does_not_guess_about_a_bus_that_is_not_udp) {
  EXPECT_EQ(check_multicast("memq://").verdict, Verdict::kUnknown);
}

TEST(Doctor, tells_every_remedy_of_what_is_bad) {
  StudioCamera camera;
  camera.name = "cam01";
  camera.address = "127.0.0.1";  // nothing listens there
  const auto findings = check_cameras({camera});
  ASSERT_EQ(findings.size(), 1U);
  EXPECT_EQ(findings[0].verdict, Verdict::kBad);
  EXPECT_FALSE(findings[0].remedy.empty());
}

// A camera's control port on a loopback address of its own: acknowledges one register read.
class FakeControlPort {
 public:
  explicit FakeControlPort(const char* address)
      : fd_(socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0)) {
    sockaddr_in here{};
    here.sin_family = AF_INET;
    here.sin_port = htons(3956);
    inet_pton(AF_INET, address, &here.sin_addr);
    bound_ = bind(fd_, reinterpret_cast<const sockaddr*>(&here), sizeof here) == 0;
    if (bound_) thread_ = std::thread([this] { answer(); });
  }
  ~FakeControlPort() {
    shutdown(fd_, SHUT_RDWR);
    if (thread_.joinable()) thread_.join();
    close(fd_);
  }
  bool bound() const { return bound_; }

 private:
  void answer() {
    uint8_t command[64];
    sockaddr_in from{};
    socklen_t size = sizeof from;
    if (recvfrom(fd_, command, sizeof command, 0, reinterpret_cast<sockaddr*>(&from), &size) < 8)
      return;
    const uint8_t ack[] = {0, 0, 0, 0x81, 0, 4, command[6], command[7], 0, 2, 0, 0};
    sendto(fd_, ack, sizeof ack, 0, reinterpret_cast<const sockaddr*>(&from), size);
  }

  int fd_;
  bool bound_ = false;
  std::thread thread_;
};

TEST(Doctor, hears_a_camera_that_answers) {
  const FakeControlPort port("127.0.1.77");
  if (!port.bound()) GTEST_SKIP() << "127.0.1.77:3956 is taken on this machine";
  StudioCamera camera;
  camera.name = "cam01";
  camera.address = "127.0.1.77";
  EXPECT_EQ(check_cameras({camera})[0].verdict, Verdict::kGood);
}

TEST(Doctor, says_that_it_cannot_ask_a_camera_given_by_its_serial_number) {
  StudioCamera camera;
  camera.name = "cam01";
  camera.address = "GV-4103";
  EXPECT_EQ(check_cameras({camera})[0].verdict, Verdict::kUnknown);
}

}  // namespace
}  // namespace v3d::ctl
