// UDP multicast sockets: join a group and receive, send to a group.
#pragma once

#include <netinet/in.h>

#include <array>
#include <atomic>
#include <cstdint>
#include <memory>
#include <mutex>
#include <span>
#include <string>

#include "daemon/datagram.h"
#include "daemon/message_seal.h"

namespace v3d {

/// A file descriptor that is closed with the object.
class Socket {
 public:
  /// UDP over IPv4. Throws InputError with errno's text.
  Socket();
  ~Socket();
  Socket(const Socket&) = delete;
  Socket& operator=(const Socket&) = delete;
  int fd() const { return fd_; }

 private:
  const int fd_;
};

/// Memory for datagrams that arrive together: 2 MiB, allocated once.
class DatagramBatch {
 public:
  static constexpr size_t kSize = 32;

  struct Received {
    std::span<const uint8_t> bytes;
    uint64_t source = 0;  ///< address and port of the sender
  };
  DatagramBatch();
  ~DatagramBatch();
  DatagramBatch(const DatagramBatch&) = delete;
  DatagramBatch& operator=(const DatagramBatch&) = delete;

 private:
  friend class MulticastReceiver;
  struct Buffers;
  const std::unique_ptr<Buffers> buffers_;
};

/// A member of a multicast group, until it is destroyed. One thread, but dropped().
class MulticastReceiver {
 public:
  /// `url` as LCM writes it. Throws InputError with the remedy when the group cannot be joined.
  explicit MulticastReceiver(const std::string& url);

  int fd() const { return socket_.fd(); }
  /// What is there, without waiting; fewer than DatagramBatch::kSize when that is all. The spans
  /// are valid until the next call with this batch.
  std::span<const DatagramBatch::Received> receive(DatagramBatch& batch);
  /// Datagrams that the kernel dropped because its receive buffer was full.
  int64_t dropped() const { return dropped_; }

 private:
  const Socket socket_;
  std::atomic<int64_t> dropped_ = 0;
};

/// Sends to a multicast group and is no member of it. Any thread.
class MulticastSender {
 public:
  /// Throws InputError with the remedy when there is no route to the group.
  explicit MulticastSender(const std::string& url);

  /// All datagrams of a message in a row, as liblcm's receivers need it: they hold one message of
  /// a sender. With `mac`, each datagram is authenticated. False when the kernel refuses one of
  /// them, or the message or the channel's name is too long.
  bool send(std::string_view channel, std::span<const uint8_t> message, const DatagramMac* mac);

 private:
  bool send_all(std::span<const OutgoingDatagram> datagrams, bool with_trailer);

  const Socket socket_;
  sockaddr_in group_{};
  const uint32_t session_;
  std::atomic<uint32_t> next_sequence_ = 0;
  std::mutex one_message_;
};

}  // namespace v3d
