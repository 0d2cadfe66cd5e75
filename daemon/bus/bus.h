// The LCM bus: bytes in, bytes out. Everything that arrives may come from anybody: what fails a
// check (message_receiver.h) or does not decode is counted and dropped.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "daemon/bus/bounded_queue.h"
#include "daemon/bus/channel_list.h"
#include "daemon/bus/frame_groups.h"
#include "daemon/bus/message_receiver.h"
#include "daemon/bus/message_seal.h"
#include "daemon/bus/sequence.h"
#include "wire/channels.h"
#include "wire/codec.h"

namespace v3d {

/// What this process did not receive, by cause.
struct ReceptionCounts {
  DatagramCounts datagrams;
  int64_t dropped_by_kernel = 0;  ///< datagrams: the receive buffer was full
};

/// One connection to the studio's network. publish() from any thread; a thread of its own receives.
class Bus {
 public:
  /// `lcm_url` and `frame_groups` as in the studio file; of the latter nothing is received before
  /// hear_frames(). `channels`: what may arrive. Throws InputError when the network cannot be
  /// reached (usually a missing multicast route), with the remedy.
  explicit Bus(const std::string& lcm_url, const std::vector<std::string>& frame_groups = {},
               ChannelList channels = {});
  ~Bus();
  Bus(const Bus&) = delete;
  Bus& operator=(const Bus&) = delete;

  /// Without a MAC. False when the network refused or the message
  /// is too long; what was sent may still not arrive.
  bool publish(const std::string& channel, std::span<const uint8_t> bytes);
  /// Each datagram with a MAC, where there is a key. Where members are required, the message with
  /// the signature of this process, if those of the channel have one (MemberSignatures).
  bool publish_sealed(const std::string& channel, std::span<const uint8_t> message);
  /// For commands and replies, which hold a MAC or signature of their own: each datagram has a MAC
  /// too where a message has several, or where all must have one (MessageSeal::cover_commands()).
  bool publish_command(std::span<const uint8_t> message);
  bool publish_reply(std::span<const uint8_t> message);
  MessageSeal& seal() { return seal_; }
  ReceptionCounts reception() const;

  /// 1 where frames travel with all else.
  size_t frame_groups() const;
  /// As publish_sealed(), in the group of its pulse.
  bool publish_frame(int64_t pulse, const std::string& channel, std::span<const uint8_t> message);
  /// Joins these frame groups and leaves the others: of those nothing comes to this machine. All
  /// subscriptions hear all groups. Nothing to do where frames travel with all else. Throws
  /// InputError when a group cannot be joined.
  void hear_frames(const FrameGroupSet& groups);

  /// A handler is called as long as this lives, which is not longer than the bus. When it is gone,
  /// so is the handler, and does not run any more.
  class Listening {
   public:
    explicit Listening(std::function<void()> end) : end_(std::move(end)) {}
    Listening(Listening&& other) noexcept : end_(std::exchange(other.end_, nullptr)) {}
    Listening& operator=(Listening&&) = delete;
    ~Listening() {
      if (end_) end_();
    }

   private:
    std::function<void()> end_;
  };
  /// Runs on the handling thread, must be short, must not throw and must not subscribe; the views
  /// are only borrowed.
  using Handler = std::function<void(const ReceivedMessage&)>;
  enum class Accept : uint8_t { kAccepted, kUnverifiedToo };
  /// `channels`: the name of one, or the beginning of several followed by ".*".
  [[nodiscard]] Listening subscribe(const std::string& channels, Handler handler,
                                    Accept accept = Accept::kAccepted);

 private:
  class Impl;
  MessageSeal seal_;
  std::unique_ptr<Impl> impl_;  ///< last: its thread uses the seal
};

/// One line with the remedy when the kernel gives less than the receive buffer that `lcm_url` asks
/// for, else empty.
std::string receive_buffer_problem(const std::string& lcm_url);

struct SubscriptionCounts {
  int64_t received = 0;     ///< messages that decoded
  int64_t dropped = 0;      ///< of these, thrown away because nobody took them in time
  int64_t undecodable = 0;  ///< bytes that are no such message, or not believed to be one
  int64_t lost = 0;         ///< messages that the sequence numbers say were sent and did not arrive
};

/// Decoded messages of one type, waiting to be taken. When the queue is full the oldest goes.
/// Construct and destroy it while the bus lives; the functions may be called from any thread.
template <class M>
class Subscription {
 public:
  /// Makes a message of what was received, or nothing. Runs on the handling thread.
  using Open = std::function<std::optional<M>(const ReceivedMessage&)>;

  /// Messages that the bus accepts.
  Subscription(Bus& bus, const std::string& channels, size_t queue_limit)
      : Subscription(bus, channels, queue_limit, [](const ReceivedMessage& in) -> std::optional<M> {
          if (!in.is_accepted) return std::nullopt;
          return decode<M>(in.bytes);
        }) {}
  /// `open` decides.
  Subscription(Bus& bus, const std::string& channels, size_t queue_limit, Open open,
               Bus::Accept accept = Bus::Accept::kAccepted)
      : inbox_(std::make_unique<Inbox>(queue_limit, std::move(open))),
        listening_(bus.subscribe(
            channels,
            [inbox = inbox_.get()](const ReceivedMessage& received) { inbox->receive(received); },
            accept)) {}

  /// The next message, waiting until `deadline`; empty when none came.
  std::optional<M> wait(MonotonicInstant deadline) { return inbox_->queue.pop(deadline); }

  SubscriptionCounts counts() const {
    return {.received = inbox_->received,
            .dropped = inbox_->queue.dropped(),
            .undecodable = inbox_->undecodable,
            .lost = inbox_->lost};
  }

 private:
  static bool is_of_channel(const M& message, std::string_view channel) {
    if constexpr (std::is_same_v<M, HealthMessage>) return channel == health_channel(message.node);
    return true;
  }

  struct Inbox {
    Inbox(size_t limit, Open opener) : open(std::move(opener)), queue(limit) {}

    void receive(const ReceivedMessage& in) {
      auto message = open(in);
      if (!message || !is_of_channel(*message, in.channel)) {
        ++undecodable;
        return;
      }
      ++received;
      if constexpr (requires { message->seq; }) {
        sequences.note(sequence_key(in.channel, *message), message->seq, message->sent);
        lost = sequences.total().lost;
      }
      queue.push(std::move(*message));
    }

    /// Several nodes send events on one channel, each with its own count.
    static std::string sequence_key(std::string_view channel, const M& message) {
      std::string key(channel);
      if constexpr (requires { message.node; }) key += " " + message.node;
      return key;
    }

    Open open;  ///< handling thread only
    BoundedQueue<M> queue;
    SequenceTracker sequences;  ///< handling thread only
    std::atomic<int64_t> received = 0;
    std::atomic<int64_t> undecodable = 0;
    std::atomic<int64_t> lost = 0;
  };

  std::unique_ptr<Inbox> inbox_;
  Bus::Listening listening_;  ///< goes first
};

}  // namespace v3d
