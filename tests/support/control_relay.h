// Relay of the control channel of a GigE Vision camera, which drops chosen requests.
#pragma once

#include <arpa/inet.h>
#include <poll.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <cstdint>
#include <cstring>
#include <span>
#include <stdexcept>
#include <string>
#include <thread>

#include "base/io/unique_fd.h"

namespace v3d::test {

/// Forwards requests from 127.0.0.31 to a camera at 127.0.0.11, and its answers to the last sender.
/// Images do not pass: the camera sends them to its client. Source: GigE Vision specification 2.0,
/// GVCP.
class ControlRelay {
 public:
  static constexpr const char* kAddress = "127.0.0.31";

  /// Throws std::runtime_error if the address is in use.
  ControlRelay() {
    const sockaddr_in here = address(kAddress);
    const sockaddr_in camera = address("127.0.0.11");
    if (bind(client_.get(), pointer(here), sizeof here) != 0 ||
        connect(camera_.get(), pointer(camera), sizeof camera) != 0) {
      throw std::runtime_error("ControlRelay: " + std::string(std::strerror(errno)));
    }
    thread_ = std::jthread([this](const std::stop_token& stop) { run(stop); });
  }

  /// From now on, requests to read this register stay without an answer.
  void drop_reads_of(uint32_t reg) { dropped_register_ = reg; }
  int dropped() const { return dropped_; }

 private:
  static constexpr uint16_t kPort = 3956;
  static constexpr uint32_t kNone = 0xffffffff;

  static sockaddr_in address(const char* ip) {
    sockaddr_in result{
        .sin_family = AF_INET, .sin_port = htons(kPort), .sin_addr = {}, .sin_zero = {}};
    inet_pton(AF_INET, ip, &result.sin_addr);
    return result;
  }
  static const sockaddr* pointer(const sockaddr_in& a) {
    return reinterpret_cast<const sockaddr*>(&a);
  }

  /// The first register that a request reads: READREG (0x80) or READMEM (0x84) after the header of
  /// 8 bytes; kNone for other requests.
  static uint32_t register_of(std::span<const uint8_t> request) {
    if (request.size() < 12 || request[2] != 0 || (request[3] != 0x80 && request[3] != 0x84)) {
      return kNone;
    }
    uint32_t reg = 0;
    std::memcpy(&reg, request.data() + 8, sizeof reg);
    return ntohl(reg);
  }

  void run(const std::stop_token& stop) {
    std::array<uint8_t, 2048> bytes{};
    sockaddr_in client{};
    while (!stop.stop_requested()) {
      std::array<pollfd, 2> ready = {{{client_.get(), POLLIN, 0}, {camera_.get(), POLLIN, 0}}};
      poll(ready.data(), ready.size(), 20);
      if (ready[0].revents != 0) {
        socklen_t size = sizeof client;
        const ssize_t n = recvfrom(client_.get(), bytes.data(), bytes.size(), 0,
                                   reinterpret_cast<sockaddr*>(&client), &size);
        const std::span request(bytes.data(), static_cast<size_t>(std::max<ssize_t>(n, 0)));
        const uint32_t reg = register_of(request);
        if (reg != kNone && reg == dropped_register_) {
          ++dropped_;
        } else {
          send(camera_.get(), request.data(), request.size(), 0);
        }
      }
      if (ready[1].revents != 0) {
        const ssize_t n = recv(camera_.get(), bytes.data(), bytes.size(), 0);
        if (n > 0) {
          sendto(client_.get(), bytes.data(), static_cast<size_t>(n), 0, pointer(client),
                 sizeof client);
        }
      }
    }
  }

  io::UniqueFd client_{socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0)};
  io::UniqueFd camera_{socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0)};
  std::atomic<uint32_t> dropped_register_ = kNone;
  std::atomic<int> dropped_ = 0;
  std::jthread thread_;  ///< last member: it uses the others
};

}  // namespace v3d::test
