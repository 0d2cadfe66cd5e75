// Receives datagrams, verifies them and reassembles messages.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string_view>

#include "daemon/bus/channel_list.h"
#include "daemon/bus/datagram.h"
#include "daemon/bus/frame_keys.h"
#include "daemon/bus/message_authenticator.h"
#include "daemon/bus/session_replay_filter.h"
#include "wire/messages.h"

namespace v3d::bus {

/// A received message without its trailer and signature; the signature of a command or reply stays.
/// The views are valid during the call of the handler only.
struct ReceivedMessage {
  std::string_view channel;
  std::span<const uint8_t> bytes;
  /// False for a message that is delivered although it is not authentic
  /// (ChannelKind::is_shown_unverified).
  bool is_accepted = true;
  /// The sending socket, of accepted messages: its session, or its address where no authentication
  /// is required. A process that restarts has another one.
  uint64_t session = 0;
  /// The least possible time since an accepted message was sent (SessionReplayFilter::age()). A
  /// process that was stopped reads old messages when it continues. Too large, by the step, if the
  /// sender's clock was set back and its session has not responded since.
  Duration age{};
  /// When an accepted message was sent, by the clock of its sender. Empty where no authentication
  /// is required.
  std::optional<RealtimeInstant> sent = {};
  /// The same time on this PC's clock (SessionReplayFilter::sent_here()); relates the two clocks.
  /// Empty where `sent` is.
  std::optional<MonotonicInstant> sent_here = {};
};

/// Counts of datagrams that were rejected before the verification of their MAC, and of incomplete
/// messages. MessageAuthenticator counts the others.
struct DatagramCounts {
  int64_t malformed = 0;   ///< not LCM's format, or not consistent
  int64_t foreign = 0;     ///< on a channel that is not in the ChannelList
  int64_t oversized = 0;   ///< of a message longer than ChannelKind::max_bytes
  int64_t incomplete = 0;  ///< messages with missing or inconsistent fragments
};

/// Callbacks with which a receiver challenges other sessions and responds for those of its own
/// process.
struct SessionPort {
  /// Sequence number of the last message of a session of this process; empty for other sessions.
  std::function<std::optional<uint32_t>(uint32_t session)> newest_of_own = [](uint32_t) {
    return std::nullopt;
  };
  /// Sends on the channel V3D_SESSION.
  std::function<void(wire::SessionMessage)> send = [](const wire::SessionMessage&) {};
};

/// Verifies datagrams in this order: structure (parse_datagram()); channel and size (fragments
/// after the first have no channel); not received before; MAC; recent (SessionReplayFilter). Only
/// then is a fragment stored for reassembly, in memory of fixed size. A rejected datagram causes no
/// allocation and at most one hash of its bytes (two while a studio key is replaced, see
/// KeyRotation).
///
/// When members are required, a message also needs the signature of a member that may send it
/// (MemberSignatures), and the response of its session must be signed with the same key. The
/// receiver verifies at most one signature a message, and none for senders without the studio key.
/// Each key has its own windows of sequence numbers, so that no member can make messages of another
/// one count as received. Before the MAC, repeated datagrams are then detected by their tag
/// (RecentTags).
///
/// When members are required, live frames need the MAC of a frame key of the node that owns the
/// camera (FrameSessions), and no other message is accepted with it. A session is then identified
/// by its number and its kind of key: a holder of the studio key cannot change the state of a frame
/// session. The announcement of a key (FrameKeyMessage) comes from a session that has responded,
/// so the frame session needs no challenge: frames before its first announcement count as received.
///
/// When a session's time is not proven to be recent, the receiver drops its messages and sends it a
/// challenge. If clocks differ, the messages before the response are lost. The first health
/// messages and pulses of every session are lost in the same way (ChannelKind::needs_challenge). If
/// later ones seem to be older than SessionReplayFilter::kSeemsOld, they are returned, and the
/// session is challenged again: its clock may have been set back (SessionReplayFilter::accept()).
///
/// When no authentication is required, the checks of MAC and time are skipped. One thread; counts()
/// may be called from any thread.
class MessageReceiver {
 public:
  /// Whether a channel has a subscription. Messages of other channels are dropped before
  /// reassembly.
  using Wanted = std::function<bool(std::string_view channel)>;

  MessageReceiver(ChannelList channels, MessageAuthenticator& authenticator, Wanted wanted,
                  SessionPort sessions = {});

  /// Returns the message that `datagram` completes; valid until the next call. `source`: address
  /// and port of the sender, which identify it when no authentication is required.
  std::optional<ReceivedMessage> receive(std::span<const uint8_t> datagram, uint64_t source,
                                         const ReceiverTime& now);
  DatagramCounts counts() const;

 private:
  std::optional<ReceivedMessage> receive_authentic(const Datagram& datagram,
                                                   const ChannelKind* kind,
                                                   const ReceiverTime& now);
  std::optional<ReceivedMessage> receive_anything(const Datagram& datagram, const ChannelKind* kind,
                                                  uint64_t source);
  std::optional<ReceivedMessage> receive_recent(const Datagram& datagram, const ChannelKind* kind,
                                                const DatagramParts& parts,
                                                const SessionStamp& stamp, const ReceiverTime& now);
  std::optional<ReceivedMessage> receive_frame(const Datagram& datagram, const ChannelKind* kind,
                                               const DatagramParts& parts, const ReceiverTime& now);
  std::optional<ReceivedMessage> receive_authentic_frame(const Datagram& datagram,
                                                         const DatagramParts& parts,
                                                         const FrameSession& session,
                                                         const ReceiverTime& now);
  bool is_repeated(const Datagram& datagram, const wire::MacTrailer& trailer) const;
  bool may_be_recent(const SessionStamp& fragment, const ReceiverTime& now) const;
  bool is_recent(const ChannelKind& kind, const SessionStamp& stamp, const wire::Signer& signer,
                 const ReceiverTime& now);
  bool is_of_frames(const ChannelKind* kind, const DatagramParts& parts,
                    MonotonicInstant now) const;
  bool may_be_frame(const ChannelKind* kind, const DatagramParts& parts) const;
  bool may_send(const FrameSession& session, std::string_view channel);
  void count_frame_without_key(const Datagram& datagram, const DatagramParts& parts,
                               MonotonicInstant now);
  void register_frame_key(const ReceivedMessage& message, const wire::Signer& signer,
                          const SessionStamp& stamp, const ReceiverTime& now);
  bool is_handled_here(const ChannelKind& kind) const;
  std::optional<ReceivedMessage> accept(ReceivedMessage message, const SessionStamp& stamp,
                                        const ReceiverTime& now);
  bool is_authentic(const Datagram& datagram, const DatagramParts& parts,
                    MonotonicInstant now) const;
  wire::Signer claimed_signer(const ChannelKind& kind, std::span<const uint8_t> message) const;
  bool can_respond(const wire::Signer& signer) const;
  void send_challenge(const SessionStamp& stamp, const wire::Signer& signer,
                      const ReceiverTime& now);
  void drop_old_challenges();
  void on_session_message(std::span<const uint8_t> bytes, const SessionStamp& stamp,
                          const ReceiverTime& now);
  void on_response(const wire::SessionMessage& response, std::span<const uint8_t> bytes,
                   const SessionStamp& stamp, const ReceiverTime& now);
  std::optional<wire::Signer> verified_signer(const wire::SessionMessage& response,
                                              std::span<const uint8_t> bytes,
                                              const SessionStamp& stamp, MonotonicInstant now);
  void respond(const wire::SessionMessage& challenge, MonotonicInstant now);
  std::optional<ReceivedMessage> reassemble(const Datagram& datagram, const DatagramParts& parts,
                                            uint64_t sender = 0);
  std::optional<ReceivedMessage> pass(std::string_view channel, std::span<const uint8_t> bytes);
  void skip(const MessageIdentity& message);

  ChannelList channels_;
  MessageAuthenticator& authenticator_;
  const Wanted wanted_;
  const SessionPort sessions_;
  SessionReplayFilter filter_;
  RecentTags recent_tags_;  ///< used when members are required
  SessionChallenges challenges_;
  FrameSessions frame_sessions_;
  SessionReplayFilter frame_filter_;  ///< of frame sessions, by FrameSession::id
  int64_t forgotten_ = 0;  ///< SessionReplayFilter::forgotten() when the challenges were sent
  MonotonicInstant responses_since_;
  int responses_ = 0;
  Reassembly reassembly_;
  SkippedMessages skipped_;  ///< without a subscription
  std::atomic<int64_t> malformed_ = 0;
  std::atomic<int64_t> foreign_ = 0;
  std::atomic<int64_t> oversized_ = 0;
  std::atomic<int64_t> incomplete_ = 0;
};

}  // namespace v3d::bus
