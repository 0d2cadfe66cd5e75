// Sender of GigE Vision images (GVSP), instead of Aravis' fake camera: it sends chunk data, which
// the fake camera does not, at the time that a test chooses.
#pragma once

#include <arpa/inet.h>
#include <sys/socket.h>
#include <unistd.h>

#include <bit>
#include <cstdint>
#include <span>
#include <stdexcept>
#include <vector>

#include "base/image/image.h"

namespace v3d::test {

/// Writer of integers and floats in network byte order.
class NetworkBytes {
 public:
  NetworkBytes& u16(uint16_t value) { return integer(value, 2); }
  NetworkBytes& u32(uint32_t value) { return integer(value, 4); }
  NetworkBytes& f64(double value) { return integer(std::bit_cast<uint64_t>(value), 8); }
  NetworkBytes& raw(std::span<const uint8_t> more) {
    bytes_.insert(bytes_.end(), more.begin(), more.end());
    return *this;
  }
  std::span<const uint8_t> bytes() const { return bytes_; }

 private:
  NetworkBytes& integer(uint64_t value, int bytes) {
    for (int i = bytes - 1; i >= 0; --i) bytes_.push_back(static_cast<uint8_t>(value >> (8 * i)));
    return *this;
  }
  std::vector<uint8_t> bytes_;
};

/// Sends to a port of 127.0.0.1. Source: GigE Vision specification 2.0, GVSP.
class GvspSender {
 public:
  explicit GvspSender(uint16_t port) : socket_(socket(AF_INET, SOCK_DGRAM, 0)) {
    to_.sin_family = AF_INET;
    to_.sin_port = htons(port);
    to_.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  }
  ~GvspSender() { close(socket_); }
  GvspSender(const GvspSender&) = delete;
  GvspSender& operator=(const GvspSender&) = delete;

  /// Sends `payload`, an image, followed by its chunks with `has_chunks`, in packets of at most
  /// `packet_bytes` bytes of payload. `pfnc`: code of the pixel format, Mono8 by default. Throws
  /// std::runtime_error.
  void send_image(uint16_t frame, ImageSize size, std::span<const uint8_t> payload,
                  size_t packet_bytes, uint32_t pfnc = 0x01080001, bool has_chunks = true) {
    const uint16_t type = has_chunks ? 0x4001 : 0x0001;
    NetworkBytes leader;
    leader.u16(0).u16(type).u32(0).u32(1000U * frame).u32(pfnc);
    leader.u32(static_cast<uint32_t>(size.width)).u32(static_cast<uint32_t>(size.height));
    leader.u32(0).u32(0).u32(0);
    uint32_t packet = 0;
    send(frame, kLeader, packet++, leader.bytes());
    for (; payload.size() > 0; payload = payload.subspan(std::min(packet_bytes, payload.size()))) {
      send(frame, kPayload, packet++, payload.first(std::min(packet_bytes, payload.size())));
    }
    NetworkBytes trailer;
    trailer.u32(type).u32(static_cast<uint32_t>(size.height));
    send(frame, kTrailer, packet, trailer.bytes());
  }

 private:
  static constexpr uint32_t kLeader = 1, kTrailer = 2, kPayload = 3;

  void send(uint16_t frame, uint32_t content, uint32_t packet, std::span<const uint8_t> data) {
    NetworkBytes bytes;
    bytes.u16(0).u16(frame).u32(content << 24 | packet).raw(data);
    const auto* to = reinterpret_cast<const sockaddr*>(&to_);
    const auto all = bytes.bytes();
    if (sendto(socket_, all.data(), all.size(), 0, to, sizeof to_) < 0) {
      throw std::runtime_error("GvspSender: sendto");
    }
  }

  int socket_;
  sockaddr_in to_{};
};

}  // namespace v3d::test
