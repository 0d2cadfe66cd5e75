// Parses LCM URLs: multicast group and socket options.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

namespace v3d {

/// Multicast address and port of an LCM network.
struct LcmGroup {
  std::string address = "239.255.76.67";  ///< LCM's default for a URL without an address
  uint16_t port = 7667;
  friend bool operator==(const LcmGroup&, const LcmGroup&) = default;
};

/// Parses the group of a URL like "udpm://239.255.76.67:7667?ttl=1". Empty when it is not a
/// multicast URL of LCM, or its address is not an IPv4 multicast address.
std::optional<LcmGroup> lcm_group(const std::string& url);

/// The options after the '?' of an LCM URL. Other options are ignored, as in liblcm.
struct LcmOptions {
  int ttl = 0;            ///< routers that a datagram may pass; 0: it stays on this host
  int recv_buf_size = 0;  ///< size of the socket's receive buffer, bytes; 0: the kernel's default
  friend bool operator==(const LcmOptions&, const LcmOptions&) = default;
};

/// Parses the options of a URL like "udpm://239.255.76.67:7667?ttl=1&recv_buf_size=16777216". Empty
/// when `ttl` or `recv_buf_size` is not a number, `ttl` exceeds 255 or `recv_buf_size` exceeds
/// 2^30.
std::optional<LcmOptions> lcm_options(const std::string& url);

}  // namespace v3d
