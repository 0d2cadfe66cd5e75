// TCP connections of a test client.
#pragma once

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/time.h>

#include <string>

#include "base/io/unique_fd.h"

namespace v3d {

/// Connects to `port` of `host`, an IPv4 address, and sends `bytes`. Without a server at the port,
/// the socket is not connected, and reading from it fails.
inline io::UniqueFd connect_to(const std::string& host, int port, const std::string& bytes) {
  io::UniqueFd fd(socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0));
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<uint16_t>(port));
  inet_pton(AF_INET, host.c_str(), &address.sin_addr);
  if (connect(fd.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0) {
    send(fd.get(), bytes.data(), bytes.size(), MSG_NOSIGNAL);
  }
  return fd;
}

/// The same on 127.0.0.1.
inline io::UniqueFd connect_to_loopback(int port, const std::string& bytes) {
  return connect_to("127.0.0.1", port, bytes);
}

/// All bytes until the other side ends the connection, or sends none for 30 s.
inline std::string read_until_end(const io::UniqueFd& fd) {
  const timeval patience{.tv_sec = 30, .tv_usec = 0};
  setsockopt(fd.get(), SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
  std::string text;
  char part[4096];
  for (ssize_t n = 0; (n = recv(fd.get(), part, sizeof part, 0)) > 0;) {
    text.append(part, static_cast<size_t>(n));
  }
  return text;
}

}  // namespace v3d
