// UDP multicast sockets: join a group and receive, send to a group.
#pragma once

#include <netinet/in.h>

#include <array>
#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <memory>
#include <mutex>
#include <span>
#include <string>

#include "base/io/unique_fd.h"
#include "daemon/bus/datagram.h"
#include "daemon/bus/message_seal.h"

namespace v3d {

/// UDP over IPv4. Throws InputError with errno's text.
io::UniqueFd udp_socket();

/// Datagrams that were received and not handled yet: a ring of 512 places of 64 KiB, allocated
/// once. One thread receives into it (MulticastReceiver), one handles; so the kernel's buffer is
/// emptied while a handler works. 512 places hold almost three pulses of 15 raw XGA images.
class DatagramRing {
 public:
  static constexpr size_t kPlaces = 512;

  struct Received {
    std::span<const uint8_t> bytes;
    uint64_t source = 0;  ///< address and port of the sender
  };
  DatagramRing();
  ~DatagramRing();
  DatagramRing(const DatagramRing&) = delete;
  DatagramRing& operator=(const DatagramRing&) = delete;

  /// The handling thread: waits for datagrams, at most `limit` of them, in the order of arrival.
  /// They are valid until release(). Empty after stop().
  std::span<const Received> wait(size_t limit = kPlaces);
  /// The handling thread: the first `count` of wait() are handled.
  void release(size_t count);
  /// Wakes both threads for good. Any thread.
  void stop();

 private:
  friend class MulticastReceiver;
  struct Buffers;
  /// Places in a row that are free, from `first` on.
  struct Room {
    size_t first = 0;
    size_t count = 0;
  };
  Room wait_for_room();
  void add(size_t count);

  const std::unique_ptr<Buffers> buffers_;
  std::mutex mutex_;  ///< what follows
  std::condition_variable changed_;
  uint64_t received_ = 0;  ///< datagrams, since the beginning
  uint64_t handled_ = 0;
  bool stopped_ = false;
};

/// A member of a multicast group, until it is destroyed. One thread, but dropped().
class MulticastReceiver {
 public:
  /// `url` as LCM writes it. Throws InputError with the remedy when the group cannot be joined.
  explicit MulticastReceiver(const std::string& url);

  int fd() const { return socket_.get(); }
  /// Brings what is there into the ring. Waits for room in the ring, not for datagrams. How many.
  size_t receive(DatagramRing& ring);
  /// Datagrams that the kernel dropped because its receive buffer was full.
  int64_t dropped() const { return dropped_; }

 private:
  const io::UniqueFd socket_;
  std::atomic<int64_t> dropped_ = 0;
};

/// Sends to a multicast group and is no member of it. Any thread.
class MulticastSender {
 public:
  /// Throws InputError with the remedy when there is no route to the group.
  explicit MulticastSender(const std::string& url);

  /// All datagrams of a message in a row, as liblcm's receivers need it: they hold one message of
  /// a sender. With `mac`, each datagram is authenticated. With `key` and `mac`, the message is
  /// signed too (sign_on_bus()). False when the kernel refuses one of the datagrams, or the message
  /// or the channel's name is too long.
  bool send(std::string_view channel, std::span<const uint8_t> message, const DatagramMac* mac,
            const SigningKey* key = nullptr);

  /// Drawn at random; in the trailer of each datagram.
  uint32_t session() const { return session_; }
  /// The sequence number of the last message.
  uint32_t newest() const { return next_sequence_ - 1; }

 private:
  bool send_all(std::span<const OutgoingDatagram> datagrams, bool with_trailer);

  const io::UniqueFd socket_;
  sockaddr_in group_{};
  const uint32_t session_;
  std::atomic<uint32_t> next_sequence_ = 0;
  std::mutex one_message_;
};

}  // namespace v3d
