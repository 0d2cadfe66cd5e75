// The multicast groups of LCM.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

namespace v3d {

/// Address and port that a network's members listen to.
struct LcmGroup {
  std::string address = "239.255.76.67";  ///< what LCM takes where its URL says nothing
  uint16_t port = 7667;
  friend bool operator==(const LcmGroup&, const LcmGroup&) = default;
};

/// Of a URL like "udpm://239.255.76.67:7667?ttl=1". Empty when that is none of LCM's for multicast,
/// or its address no multicast address of IPv4.
std::optional<LcmGroup> lcm_group(const std::string& url);

/// What an LCM URL says behind its '?'. Other options are ignored, as liblcm does.
struct LcmOptions {
  int ttl = 0;            ///< routers that a datagram may pass; 0: none leaves the machine
  int recv_buf_size = 0;  ///< bytes of the socket's receive buffer; 0: the kernel's default
  friend bool operator==(const LcmOptions&, const LcmOptions&) = default;
};

/// Of a URL like "udpm://239.255.76.67:7667?ttl=1&recv_buf_size=16777216". Empty when one of the
/// two is no number, `ttl` above 255 or `recv_buf_size` beyond 2^30.
std::optional<LcmOptions> lcm_options(const std::string& url);

}  // namespace v3d
