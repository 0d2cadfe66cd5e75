// Datagrams to messages: the checks that every datagram passes before a byte of it is kept.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string_view>

#include "daemon/bus/channel_list.h"
#include "daemon/bus/datagram.h"
#include "daemon/bus/message_seal.h"
#include "daemon/bus/reassembly.h"
#include "daemon/bus/session_gate.h"
#include "wire/messages.h"

namespace v3d {

/// As handlers get it, without trailer and signature (that of a command or reply stays); the views
/// are only borrowed.
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

/// How a receiver asks other sessions, and answers for those of its own process.
struct SessionPort {
  /// Sequence number of the last message of a session of this process; empty when it is none.
  std::function<std::optional<uint32_t>(uint32_t session)> newest_of_own = [](uint32_t) {
    return std::nullopt;
  };
  /// Sends to all, on V3D_SESSION.
  std::function<void(SessionMessage)> send = [](const SessionMessage&) {};
};

/// In this order: structure (parse_datagram); channel and size (fragments after the first have no
/// channel); not received before; MAC; recent (SessionGate). Only then does a fragment reach the
/// reassembly, whose memory is fixed. Nothing is allocated for a datagram that fails, and it costs
/// at most the hash of its own bytes (two while a studio key is replaced: KeyRotation).
///
/// Where members are required, a message then needs the signature of the member that may send it
/// (MemberSignatures), and a session its answer signed with the same key. One signature for each
/// message of a holder of the studio key; none for strangers.
///
/// Messages of a session that is in doubt are dropped, and the session is asked: where clocks do
/// not agree, the first messages are lost until the answer is there. So are the first health and
/// pulses of every session (ChannelKind::needs_answer).
///
/// Where no authentication is required, the checks of MAC and time are left out. One thread, but
/// counts().
class MessageReceiver {
 public:
  /// Whether somebody subscribes to a channel: other messages are dropped before reassembly.
  using Wanted = std::function<bool(std::string_view channel)>;

  MessageReceiver(ChannelList channels, MessageSeal& seal, Wanted wanted,
                  SessionPort sessions = {});

  /// The message that `datagram` completes; valid until the next call. `source`: who sent it, by
  /// the network's account, to tell senders apart where nothing is verified.
  std::optional<ReceivedMessage> receive(std::span<const uint8_t> datagram, uint64_t source,
                                         const ReceiverTime& now);
  DatagramCounts counts() const;

 private:
  struct Sequence {
    uint64_t sender = 0;
    uint32_t number = 0;
    friend bool operator==(const Sequence&, const Sequence&) = default;
  };
  std::optional<ReceivedMessage> receive_authentic(const Datagram& datagram,
                                                   const ChannelKind* kind,
                                                   const ReceiverTime& now);
  std::optional<ReceivedMessage> receive_anything(const Datagram& datagram, const ChannelKind* kind,
                                                  uint64_t source);
  std::optional<ReceivedMessage> receive_recent(const Datagram& datagram, const ChannelKind* kind,
                                                const DatagramParts& parts,
                                                const SessionStamp& stamp, const ReceiverTime& now);
  std::optional<ReceivedMessage> accept(ReceivedMessage message, const SessionStamp& stamp,
                                        const ReceiverTime& now);
  bool is_authentic(const Datagram& datagram, const DatagramParts& parts,
                    MonotonicInstant now) const;
  Signer claimed_signer(const Datagram& datagram, const ChannelKind* kind,
                        std::span<const uint8_t> data) const;
  bool can_answer(const Signer& signer) const;
  void ask(const SessionStamp& stamp, const Signer& signer, const ReceiverTime& now);
  void drop_old_questions();
  void on_session_message(std::span<const uint8_t> bytes, const SessionStamp& stamp,
                          const ReceiverTime& now);
  void on_answer(const SessionMessage& answer, std::span<const uint8_t> bytes,
                 const SessionStamp& stamp, const ReceiverTime& now);
  std::optional<Signer> verified_signer(const SessionMessage& answer,
                                        std::span<const uint8_t> bytes, const SessionStamp& stamp,
                                        MonotonicInstant now);
  void answer(const SessionMessage& question, MonotonicInstant now);
  std::optional<ReceivedMessage> reassemble(const Datagram& datagram, const DatagramParts& parts,
                                            uint64_t sender);
  std::optional<ReceivedMessage> pass(std::string_view channel, std::span<const uint8_t> bytes);
  bool is_skipped(const Sequence& message) const;
  void skip(const Sequence& message);

  ChannelList channels_;
  MessageSeal& seal_;
  const Wanted wanted_;
  const SessionPort sessions_;
  SessionGate gate_;
  SessionQuestions questions_;
  int64_t forgotten_ = 0;  ///< SessionGate::forgotten() when the questions were asked
  MonotonicInstant answers_since_;
  int answers_ = 0;
  Reassembly reassembly_;
  /// Messages nobody wants, where nothing is verified: by a hash of their sender.
  std::array<Sequence, 256> skipped_{};
  std::atomic<int64_t> malformed_ = 0;
  std::atomic<int64_t> foreign_ = 0;
  std::atomic<int64_t> oversized_ = 0;
  std::atomic<int64_t> incomplete_ = 0;
};

}  // namespace v3d
