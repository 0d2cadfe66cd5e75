// Publish-subscribe messaging over LCM's UDP multicast. Received bytes are untrusted: a message
// that fails a check (message_receiver.h) or does not decode is counted and dropped.
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

#include "daemon/bus/channel_list.h"
#include "daemon/bus/message_authenticator.h"
#include "daemon/bus/message_receiver.h"
#include "daemon/bus/subscription_queue.h"
#include "wire/codec.h"
#include "wire/messages.h"

namespace v3d::bus {

/// Datagrams and messages that this process did not receive, by cause.
struct ReceptionCounts {
  DatagramCounts datagrams;
  int64_t dropped_by_kernel = 0;  ///< datagrams, because the receive buffer was full
};

/// One connection to the studio's network. The publish functions may be called from any thread. The
/// bus starts its own threads that receive and that run the handlers.
class Bus {
 public:
  /// `lcm_url` and `frame_groups` are as in the studio file; no frame group is joined before
  /// join_frame_groups(). `channels`: the channels that are received. Throws InputError for
  /// another syntax of the URL, and std::runtime_error with the remedy when the network cannot be
  /// reached: usually a multicast route is missing, or the network is not up yet.
  explicit Bus(const std::string& lcm_url, const std::vector<std::string>& frame_groups = {},
               ChannelList channels = {});
  ~Bus();
  Bus(const Bus&) = delete;
  Bus& operator=(const Bus&) = delete;

  /// Sends without a MAC. Returns false when the kernel returned an error or the message is too
  /// long. True does not mean that the message arrives.
  bool publish(const std::string& channel, std::span<const uint8_t> bytes);
  /// Sends each datagram with a MAC when there is a studio key. When members are required and the
  /// channel's messages are signed, appends the signature of this process (MemberSignatures).
  bool publish_authenticated(const std::string& channel, std::span<const uint8_t> message);
  /// Sends a command or reply, which contains its own MAC or signature. Each datagram gets a MAC
  /// too when there is a studio key.
  bool publish_command(std::span<const uint8_t> message);
  bool publish_reply(std::span<const uint8_t> message);
  MessageAuthenticator& authenticator() { return authenticator_; }
  ReceptionCounts reception() const;

  /// Number of frame groups; 1 when frames use the common group.
  size_t frame_groups() const;
  /// Sends like publish_authenticated(), to the frame group of the pulse. When members are
  /// required, the MAC is that of the frame key (OwnFrameKey); returns false before
  /// announce_frame_key().
  bool publish_frame(int64_t pulse, const std::string& channel, std::span<const uint8_t> message);
  /// To be called once a second by a node that sends frames. When members are required and their
  /// list is known, draws a frame key when necessary and sends it to the reconstruction nodes, in
  /// the name of `node`. Repeats it after a challenge (V3D_SESSION), because the process that sent
  /// the challenge has just dropped it.
  void announce_frame_key(const std::string& node);
  /// Joins these frame groups and leaves the others, so that the switch does not send their traffic
  /// to this PC. Every subscription receives from all joined groups. Has no effect when frames use
  /// the common group. Throws std::runtime_error when a group cannot be joined; all others are
  /// joined then, and a repeated call tries that group again.
  void join_frame_groups(const FrameGroupSet& groups);

  /// Owns the registration of a handler. The destructor waits until the handler has returned and
  /// removes it. Must be destroyed before the bus.
  class HandlerRegistration {
   public:
    explicit HandlerRegistration(std::function<void()> end) : end_(std::move(end)) {}
    HandlerRegistration(HandlerRegistration&& other) noexcept
        : end_(std::exchange(other.end_, nullptr)) {}
    HandlerRegistration& operator=(HandlerRegistration&&) = delete;
    ~HandlerRegistration() {
      if (end_) end_();
    }

   private:
    std::function<void()> end_;
  };
  /// Runs on the handling thread. Must be short, must not throw and must not subscribe. The views
  /// in the message are valid during the call only.
  using Handler = std::function<void(const ReceivedMessage&)>;
  enum class Accept : uint8_t { kAccepted, kIncludingUnverified };
  /// `channels`: the name of one channel, or a common prefix followed by ".*".
  [[nodiscard]] HandlerRegistration subscribe(const std::string& channels, Handler handler,
                                              Accept accept = Accept::kAccepted);

 private:
  class Impl;
  MessageAuthenticator authenticator_;
  std::unique_ptr<Impl> impl_;  ///< last member: its threads use `authenticator_`
};

/// One line with the remedy when the kernel grants a smaller receive buffer than `lcm_url`
/// requests; otherwise empty.
std::string receive_buffer_problem(const std::string& lcm_url);

/// Counters of one subscription, since it was made.
struct SubscriptionCounts {
  int64_t received = 0;     ///< messages that decoded
  int64_t dropped = 0;      ///< of these, dropped because the queue was full
  int64_t undecodable = 0;  ///< messages that do not decode, or that `open` rejected
  int64_t lost = 0;         ///< messages that did not arrive, by their sequence numbers
};

/// A queue of decoded messages of one type. When it is full, the oldest message is dropped.
/// Construct and destroy it while the bus exists. The functions may be called from any thread.
template <class M>
class Subscription {
 public:
  /// Decodes a received message; empty when it is rejected. Runs on the handling thread.
  using Open = std::function<std::optional<M>(const ReceivedMessage&)>;

  /// Subscribes to accepted messages. `queue_limit` is in messages.
  Subscription(Bus& bus, const std::string& channels, size_t queue_limit)
      : Subscription(bus, channels, queue_limit, [](const ReceivedMessage& in) -> std::optional<M> {
          if (!in.is_accepted) return std::nullopt;
          return wire::decode<M>(in.bytes);
        }) {}
  /// Subscribes to messages that `open` decodes.
  Subscription(Bus& bus, const std::string& channels, size_t queue_limit, Open open,
               Bus::Accept accept = Bus::Accept::kAccepted)
      : inbox_(std::make_unique<Inbox>(queue_limit, std::move(open))),
        registration_(bus.subscribe(
            channels,
            [inbox = inbox_.get()](const ReceivedMessage& received) { inbox->receive(received); },
            accept)) {}

  /// Waits until `deadline` for the next message; empty when none arrived.
  std::optional<M> wait(MonotonicInstant deadline) { return inbox_->queue.pop(deadline); }

  SubscriptionCounts counts() const {
    return {.received = inbox_->received,
            .dropped = inbox_->queue.dropped(),
            .undecodable = inbox_->undecodable,
            .lost = inbox_->lost};
  }

 private:
  static bool is_of_channel(const M& message, std::string_view channel) {
    if constexpr (std::is_same_v<M, wire::HealthMessage>)
      return channel == wire::health_channel(message.node);
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

    /// Several nodes send events on one channel, each with its own sequence numbers.
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
  Bus::HandlerRegistration registration_;  ///< destroyed first: its handler uses `inbox_`
};

}  // namespace v3d::bus
