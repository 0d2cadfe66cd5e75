// Test fixture: Studio4 with v3d-viewd, and an HTTP client for it.
#pragma once

#include <poll.h>
#include <sys/socket.h>
#include <sys/stat.h>

#include <memory>
#include <regex>

#include "base/io/unique_fd.h"
#include "studio4.h"
#include "support/loopback_connection.h"

namespace v3d::test {

/// One HTTP or WebSocket connection to 127.0.0.1, as raw bytes. It sends its request at
/// construction.
class Connection {
 public:
  Connection(int port, const std::string& target, const std::string& more_fields,
             const std::string& method = "GET", const std::string& content = "")
      : fd_(connect_to_loopback(port, method + " " + target +
                                          " HTTP/1.1\r\nHost: 127.0.0.1:" + std::to_string(port) +
                                          "\r\n" + more_fields + "\r\n" + content)) {}

  /// All bytes received until now. Does not wait.
  const std::string& text() {
    pollfd ready{fd_.get(), POLLIN, 0};
    char part[65536];
    while (poll(&ready, 1, 0) > 0) {
      const ssize_t got = recv(fd_.get(), part, sizeof part, 0);
      if (got <= 0) break;
      text_.append(part, static_cast<size_t>(got));
    }
    return text_;
  }
  /// Waits up to 30 s until the received bytes hold `part`. False at timeout.
  bool receives(const std::string& part) {
    return becomes_true([&] { return text().find(part) != std::string::npos; }, within(30));
  }

 private:
  const io::UniqueFd fd_;
  std::string text_;
};

inline constexpr char kOperatorToken[] = "operators-0123456789";
/// Lines of the section [viewer] with which v3d-viewd accepts orders.
inline constexpr char kAcceptsOrders[] = "control = true\noperator_token = \"operator.token\"\n";

/// Waits up to 30 s until v3d-viewd serves, and returns its port. Throws std::runtime_error.
inline int served_port(const ChildProcess& viewd) {
  std::string output;
  std::smatch found;
  const std::regex serves("serves http://127.0.0.1:(\\d+)/");
  becomes_true(
      [&] {
        output = viewd.output();
        return std::regex_search(output, found, serves);
      },
      within(30));
  if (found.empty()) throw std::runtime_error("v3d-viewd: " + output);
  return std::stoi(found[1]);
}

/// Studio4 with v3d-viewd, which serves a minimal page.
class ViewedStudio : public Studio4 {
 protected:
  /// `more`: lines appended to the section [viewer] of the studio file.
  explicit ViewedStudio(const std::string& more = "", const Studio4Options& options = {})
      : Studio4(with_viewer(more, options)) {
    write_text(folder_ / "operator.token", std::string(kOperatorToken) + "\n");
    chmod((folder_ / "operator.token").c_str(), 0600);
    std::filesystem::create_directories(folder_ / "page");
    std::ofstream(folder_ / "page/index.html") << "<!doctype html>";
    viewd_.emplace(std::vector<std::string>{bin("v3d-viewd"), "--studio", folder_ / "studio.toml"},
                   folder_ / "v3d-viewd.log");
    port_ = served_port(*viewd_);
  }

  static Studio4Options with_viewer(const std::string& more, Studio4Options options) {
    options.more += "\n[viewer]\nlisten = \"127.0.0.1:0\"\npage = \"page\"\n" + more;
    return options;
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

  /// Posts an order, as JSON.
  std::unique_ptr<Connection> post(const std::string& order, const std::string& token) const {
    return std::make_unique<Connection>(
        port_, "/api/order",
        "Connection: close\r\nContent-Type: application/json\r\nX-V3D-Operator: " + token +
            "\r\nContent-Length: " + std::to_string(order.size()) + "\r\n",
        "POST", order);
  }

  std::optional<ChildProcess> viewd_;
  int port_ = 0;
};

}  // namespace v3d::test
