// UDP multicast sockets: receive from a group, send to a group.
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
#include "daemon/bus/message_authenticator.h"

namespace v3d::bus {

/// Opens a UDP socket for IPv4. Throws std::runtime_error with errno's text.
io::UniqueFd udp_socket();

/// Ring buffer of received datagrams: 512 places of 64 KiB, allocated once.
///
/// One thread receives into it (MulticastReceiver), one handles the datagrams, so that the kernel's
/// buffer is emptied while a handler runs. 512 places hold almost three pulses of 15 raw XGA
/// images.
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

  /// Waits for datagrams and returns at most `limit` of them, in the order of arrival. They are
  /// valid until release(). Empty after stop(). For the handling thread.
  std::span<const Received> wait(size_t limit = kPlaces);
  /// Frees the places of the first `count` datagrams of wait(). For the handling thread.
  void release(size_t count);
  /// Ends all waits, now and later. Any thread.
  void stop();

 private:
  friend class MulticastReceiver;
  struct Buffers;
  /// Contiguous free places, from `first` on.
  struct FreeRange {
    size_t first = 0;
    size_t count = 0;
  };
  FreeRange wait_for_free_range();
  void add(size_t count);

  const std::unique_ptr<Buffers> buffers_;
  std::mutex mutex_;  ///< guards the members below
  std::condition_variable changed_;
  uint64_t received_ = 0;  ///< datagrams, since construction
  uint64_t handled_ = 0;
  bool stopped_ = false;
};

/// A socket that is a member of a multicast group until it is destroyed. One thread; dropped() may
/// be called from any thread.
class MulticastReceiver {
 public:
  /// `url`: the address of the group in LCM's syntax. Throws InputError for
  /// another syntax, and std::runtime_error with the remedy when the group cannot be joined.
  explicit MulticastReceiver(const std::string& url);

  int fd() const { return socket_.get(); }
  /// Moves available datagrams into the ring and returns their number. Waits for free places in the
  /// ring, not for datagrams.
  size_t receive(DatagramRing& ring);
  /// Datagrams that the kernel dropped because its receive buffer was full.
  int64_t dropped() const { return dropped_; }

 private:
  const io::UniqueFd socket_;
  std::atomic<int64_t> dropped_ = 0;
};

/// A session of this process: its random number, in the trailer of each datagram, and the sequence
/// numbers of its messages. Any thread.
class SendingSession {
 public:
  uint32_t number() const { return number_; }
  /// The sequence number of the last message; 2^32 - 1 before the first.
  uint32_t newest() const { return next_ - 1; }
  uint32_t take_sequence() { return next_++; }

 private:
  const uint32_t number_ = wire::random_session();
  std::atomic<uint32_t> next_ = 0;
};

/// Sends to a multicast group without joining it. Any thread.
class MulticastSender {
 public:
  /// Throws std::runtime_error with the remedy when there is no route to the group.
  explicit MulticastSender(const std::string& url);

  /// Sends all datagrams of a message without others between them: liblcm's receivers reassemble
  /// one message of a sender at a time. With `mac`, each datagram gets a MAC. With `key` and `mac`,
  /// the message is signed too (sign_on_bus()). Returns false when the kernel does not accept a
  /// datagram, or the message or the channel's name is too long.
  bool send(std::string_view channel, std::span<const uint8_t> message,
            const wire::DatagramMac* mac, const wire::SigningKey* key = nullptr) {
    return send_in(session_, channel, message, mac, key);
  }
  /// The same in another session than that of this socket. Several sockets may send in it.
  bool send_in(SendingSession& session, std::string_view channel, std::span<const uint8_t> message,
               const wire::DatagramMac* mac, const wire::SigningKey* key = nullptr);

  const SendingSession& session() const { return session_; }

 private:
  bool send_all(std::span<const OutgoingDatagram> datagrams, bool with_trailer);

  const io::UniqueFd socket_;
  sockaddr_in group_{};
  SendingSession session_;
  std::mutex one_message_;  ///< keeps the datagrams of a message together
};

}  // namespace v3d::bus
