// What a browser gets of a studio that records, from the real v3d-viewd.
#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <memory>
#include <regex>

#include "studio4.h"

namespace v3d {
namespace {

using test::becomes_true;
using test::within;
using testing::HasSubstr;

constexpr int kPulses = 40;

/// One HTTP connection, or WebSocket, as bytes.
class Connection {
 public:
  Connection(int port, const std::string& target, const std::string& more_fields)
      : fd_(socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    sockaddr_in there{};
    there.sin_family = AF_INET;
    there.sin_port = htons(static_cast<uint16_t>(port));
    there.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    if (connect(fd_, reinterpret_cast<const sockaddr*>(&there), sizeof there) != 0) return;
    const std::string request = "GET " + target +
                                " HTTP/1.1\r\nHost: 127.0.0.1:" + std::to_string(port) + "\r\n" +
                                more_fields + "\r\n";
    send(fd_, request.data(), request.size(), MSG_NOSIGNAL);
  }
  ~Connection() { close(fd_); }
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;

  /// Everything that has come.
  const std::string& text() {
    pollfd ready{fd_, POLLIN, 0};
    char part[65536];
    while (poll(&ready, 1, 0) > 0) {
      const ssize_t got = recv(fd_, part, sizeof part, 0);
      if (got <= 0) break;
      text_.append(part, static_cast<size_t>(got));
    }
    return text_;
  }
  bool hears(const std::string& what) {
    return becomes_true([&] { return text().find(what) != std::string::npos; }, within(30));
  }

 private:
  const int fd_;
  std::string text_;
};

class ViewedStudio : public test::Studio4 {
 protected:
  ViewedStudio() : Studio4({.more = "\n[viewer]\nlisten = \"127.0.0.1:0\"\npage = \"page\"\n"}) {
    std::filesystem::create_directories(folder_ / "page");
    std::ofstream(folder_ / "page/index.html") << "<!doctype html>";
    viewd_.emplace(std::vector<std::string>{bin("v3d-viewd"), "--studio", folder_ / "studio.toml"},
                   folder_ / "v3d-viewd.log");
    std::smatch found;
    const std::regex serves("serves http://127.0.0.1:(\\d+)/");
    becomes_true(
        [&] {
          said_ = viewd_->output();
          return std::regex_search(said_, found, serves);
        },
        within(30));
    if (found.empty()) throw std::runtime_error("v3d-viewd: " + said_);
    port_ = std::stoi(found[1]);
  }

  std::unique_ptr<Connection> get(const std::string& target) const {
    return std::make_unique<Connection>(port_, target, "Connection: close\r\n");
  }
  std::unique_ptr<Connection> watch(const std::string& target) const {
    return std::make_unique<Connection>(
        port_, target,
        "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
        "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n");
  }

  std::optional<test::ChildProcess> viewd_;
  std::string said_;
  int port_ = 0;
};

TEST_F(ViewedStudio, shows_browsers_its_state_its_pictures_its_meshes_and_its_take) {
  const auto studio = watch("/api/studio");
  const auto live = watch("/api/live");
  EXPECT_TRUE(studio->hears("\"state\":\"idle\"")) << studio->text() << viewd_->output();
  arm_and_start(kPulses);
  EXPECT_TRUE(studio->hears("\"state\":\"recording\"")) << viewd_->output();
  EXPECT_TRUE(studio->hears("\"type\":\"preview\"")) << viewd_->output();
  EXPECT_TRUE(live->hears("\"pulse\":39")) << viewd_->output();
  ASSERT_TRUE(becomes_idle()) << log();
  ASSERT_TRUE(command(CommandVerb::kStop).done()) << log();
  EXPECT_TRUE(get("/api/takes")->hears("\"meshes\":40")) << get("/api/takes")->text();
  EXPECT_TRUE(get("/api/takes")->hears("\"state\":\"complete\""));
  EXPECT_TRUE(get("/api/takes/kendo-07/rig")->hears("\"name\":\"cam04\""));
  EXPECT_TRUE(get("/takes/kendo-07/mesh.v3d")->hears("V3DM"));
  EXPECT_TRUE(get("/takes/kendo-07/cam01.lcmlog")->hears("404 Not Found"));
}

TEST_F(ViewedStudio, outlives_whoever_sends_it_rubbish_or_never_reads) {
  std::vector<std::unique_ptr<Connection>> strangers;
  for (int i = 0; i < 40; ++i) {
    strangers.push_back(watch("/api/live"));
    strangers.push_back(std::make_unique<Connection>(port_, "/", std::string(20'000, 'x')));
    strangers.push_back(std::make_unique<Connection>(port_, "\r\n\r\n\x16\x03\x01", "\r\n"));
  }
  strangers.clear();
  EXPECT_TRUE(get("/")->hears("<!doctype html>")) << viewd_->output();
  EXPECT_TRUE(viewd_->runs());
  viewd_->signal(SIGTERM);
  EXPECT_EQ(viewd_->wait(within(10)), 0) << viewd_->output();
}

}  // namespace
}  // namespace v3d
