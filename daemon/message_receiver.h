// Datagrams to messages: the checks that every datagram passes before a byte of it is kept.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string_view>

#include "daemon/channel_list.h"
#include "daemon/datagram.h"
#include "daemon/message_seal.h"
#include "daemon/reassembly.h"
#include "daemon/sequence_window.h"

namespace v3d {

/// As handlers get it, without a trailer; the views are only borrowed.
struct ReceivedMessage {
  std::string_view channel;
  std::span<const uint8_t> bytes;
  /// False for what a person may see although it is not authentic (ChannelKind).
  bool is_accepted = true;
};

/// Datagrams that were rejected before their MAC was looked at, and messages that were lost; what
/// fails the MAC is counted in the seal. Read by any thread.
struct DatagramCounts {
  int64_t malformed = 0;   ///< not LCM's format, or not consistent
  int64_t foreign = 0;     ///< of a channel that is none of the studio's
  int64_t oversized = 0;   ///< of a message longer than its channel's are
  int64_t incomplete = 0;  ///< messages some of whose fragments did not come
};

/// In this order: structure (parse_datagram); channel and size (fragments after the first have no
/// channel); not received before; MAC; `sent` at most NewsGate::kOldest ago and kAhead in the
/// future. Only then does a fragment reach the reassembly, whose memory is fixed. Nothing is
/// allocated for a datagram, and one that fails costs at most the hash of its own bytes.
///
/// Where no authentication is required, the checks of MAC and time are left out. One thread, but
/// counts().
class MessageReceiver {
 public:
  /// Whether somebody subscribes to a channel: other messages are dropped before reassembly.
  using Wanted = std::function<bool(std::string_view channel)>;

  MessageReceiver(ChannelList channels, MessageSeal& seal, Wanted wanted);

  /// The message that `datagram` completes; valid until the next call. `source`: who sent it, by
  /// the network's account, to tell senders apart where nothing is verified.
  std::optional<ReceivedMessage> receive(std::span<const uint8_t> datagram, uint64_t source,
                                         RealtimeInstant now);
  DatagramCounts counts() const;

 private:
  struct Sequence {
    uint64_t sender = 0;
    uint32_t number = 0;
    friend bool operator==(const Sequence&, const Sequence&) = default;
  };
  std::optional<ReceivedMessage> receive_authentic(const Datagram& datagram,
                                                   const ChannelKind* kind, RealtimeInstant now);
  std::optional<ReceivedMessage> receive_anything(const Datagram& datagram, const ChannelKind* kind,
                                                  uint64_t source);
  bool is_authentic(const Datagram& datagram, const DatagramParts& parts) const;
  bool is_recent(const MacTrailer& trailer, RealtimeInstant now);
  std::optional<ReceivedMessage> reassemble(const Datagram& datagram, const DatagramParts& parts,
                                            uint64_t sender);
  std::optional<ReceivedMessage> pass(std::string_view channel, std::span<const uint8_t> bytes);
  bool is_skipped(const Sequence& message) const;
  void skip(const Sequence& message);

  ChannelList channels_;
  MessageSeal& seal_;
  const Wanted wanted_;
  SequenceWindows windows_;
  Reassembly reassembly_;
  /// Messages nobody wants, where nothing is verified: by a hash of their sender.
  std::array<Sequence, 256> skipped_{};
  std::atomic<int64_t> malformed_ = 0;
  std::atomic<int64_t> foreign_ = 0;
  std::atomic<int64_t> oversized_ = 0;
  std::atomic<int64_t> incomplete_ = 0;
};

}  // namespace v3d
