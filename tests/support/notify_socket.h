// The notification socket of systemd, for tests.
#pragma once

#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <cstdlib>
#include <string>

namespace v3d::test {

/// Receives the notifications of this process, and of daemons that it starts, as a service with a
/// watchdog of 0.4 s.
class NotifySocket {
 public:
  explicit NotifySocket(const std::string& path)
      : fd_(socket(AF_UNIX, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0)) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    path.copy(address.sun_path, sizeof address.sun_path - 1);
    if (bind(fd_, reinterpret_cast<sockaddr*>(&address), sizeof address) != 0) ADD_FAILURE();
    setenv("NOTIFY_SOCKET", path.c_str(), 1);
    setenv("WATCHDOG_USEC", "400000", 1);
  }
  ~NotifySocket() {
    unsetenv("NOTIFY_SOCKET");
    unsetenv("WATCHDOG_USEC");
    close(fd_);
  }
  NotifySocket(const NotifySocket&) = delete;
  NotifySocket& operator=(const NotifySocket&) = delete;

  /// All notifications until now, one line each.
  const std::string& received() {
    char line[4096];
    for (ssize_t n = 0; (n = recv(fd_, line, sizeof line, 0)) > 0;) {
      received_.append(line, static_cast<size_t>(n));
      received_ += '\n';
    }
    return received_;
  }
  /// How often `word` was received until now.
  int count(const std::string& word) {
    received();
    int found = 0;
    for (size_t at = 0; (at = received_.find(word, at)) != std::string::npos; ++at) ++found;
    return found;
  }

 private:
  int fd_;
  std::string received_;
};

}  // namespace v3d::test
