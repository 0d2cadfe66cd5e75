// TCP connections of a test client.
#pragma once

#include <netinet/in.h>
#include <sys/socket.h>

#include <string>

#include "base/io/unique_fd.h"

namespace v3d {

/// Connects to `port` on 127.0.0.1 and sends `bytes`. Without a server at the port, the socket is
/// not connected, and reading from it fails.
inline io::UniqueFd connect_to_loopback(int port, const std::string& bytes) {
  io::UniqueFd fd(socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0));
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<uint16_t>(port));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  if (connect(fd.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0) {
    send(fd.get(), bytes.data(), bytes.size(), MSG_NOSIGNAL);
  }
  return fd;
}

}  // namespace v3d
