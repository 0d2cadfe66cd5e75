#include "daemon/bus/message_receiver.h"

#include <fmt/format.h>

#include <chrono>
#include <cmath>
#include <string>
#include <utility>

#include "wire/codec.h"
#include "wire/messages.h"

namespace v3d::bus {
namespace {

constexpr char kMalformed[] =
    "malformed datagrams are rejected: an attacker, or a faulty program on the studio's network";
constexpr char kOversized[] =
    "messages longer than the limit of their channel are rejected: an attacker, or another V3D "
    "version";

/// Limit of responses a second. It permits several to each of 16 nodes at once.
constexpr int kMaxResponses = 100;

std::string clocks_differ(Duration ahead) {
  return fmt::format(
      "the clock of another process is {:.1f} s {} this one; its messages are accepted. Try: "
      "chronyc tracking, here and there",
      std::abs(to_seconds(ahead)), ahead > Duration::zero() ? "ahead of" : "behind");
}

SessionStamp stamp_of(const Datagram& datagram, const wire::MacTrailer& trailer) {
  return {.session = trailer.session, .sequence = datagram.sequence, .sent = trailer.sent};
}

wire::MessageOrigin origin_of(std::string_view channel, const SessionStamp& stamp) {
  return {
      .channel = channel, .session = stamp.session, .sequence = stamp.sequence, .sent = stamp.sent};
}

/// Removes the signature of a message without verifying it.
std::span<const uint8_t> without_signature(const ChannelKind& kind,
                                           std::span<const uint8_t> bytes) {
  if (!kind.is_signed()) return bytes;
  const auto split = wire::split_signature(bytes);
  return split ? split->message : bytes;
}

/// `sender`: a frame session, a source address, or 0 for the session in the trailer.
MessageIdentity identity_of(const Datagram& datagram, const DatagramParts& parts,
                            uint64_t sender = 0) {
  const size_t trailer = parts.trailer ? wire::kMacTrailerSize : 0;
  if (sender == 0 && parts.trailer) sender = parts.trailer->session;
  return {.sender = sender,
          .sequence = datagram.sequence,
          .sent_ns = parts.trailer ? to_ns(parts.trailer->sent) : 0,
          .size = datagram.message_size - static_cast<uint32_t>(trailer),
          .count = datagram.count};
}

}  // namespace

MessageReceiver::MessageReceiver(ChannelList channels, MessageAuthenticator& authenticator,
                                 Wanted wanted, SessionPort sessions)
    : channels_(std::move(channels)),
      authenticator_(authenticator),
      wanted_(std::move(wanted)),
      sessions_(std::move(sessions)) {}

std::optional<ReceivedMessage> MessageReceiver::receive(std::span<const uint8_t> bytes,
                                                        uint64_t source, const ReceiverTime& now) {
  const auto datagram = parse_datagram(bytes);
  if (!datagram) {
    ++malformed_;
    authenticator_.report(kMalformed);
    return std::nullopt;
  }
  const ChannelKind* kind = nullptr;
  if (datagram->number == 0) {
    kind = channels_.find(datagram->channel);
    if (kind == nullptr) {
      ++foreign_;
      return std::nullopt;
    }
    if (datagram->message_size > kind->max_bytes) {
      ++oversized_;
      authenticator_.report(kOversized);
      return std::nullopt;
    }
  }
  return authenticator_.is_required() ? receive_authentic(*datagram, kind, now)
                                      : receive_anything(*datagram, kind, source);
}

std::optional<ReceivedMessage> MessageReceiver::receive_authentic(const Datagram& datagram,
                                                                  const ChannelKind* kind,
                                                                  const ReceiverTime& now) {
  const bool is_first = kind != nullptr;
  const bool is_of_sessions = datagram.is_whole() && kind->is_of_sessions;
  if (datagram.is_whole() && !is_handled_here(*kind) && !wanted_(datagram.channel)) {
    return std::nullopt;
  }
  const DatagramParts parts = split_trailer(datagram);
  if (is_of_frames(kind, parts, now.monotonic)) return receive_frame(datagram, kind, parts, now);
  if (skipped_.contains(identity_of(datagram, parts))) return std::nullopt;
  if (parts.trailer && is_repeated(datagram, *parts.trailer)) {
    if (is_first) authenticator_.count_replayed();
    return std::nullopt;
  }
  if (!is_authentic(datagram, parts, now.monotonic)) {
    if (may_be_frame(kind, parts)) {
      authenticator_.count_unkeyed();
      return std::nullopt;
    }
    authenticator_.count_unverified();
    if (kind == nullptr || !is_shown_unverified(datagram, *kind)) return std::nullopt;
    return ReceivedMessage{datagram.channel, without_signature(*kind, parts.data), false};
  }
  const SessionStamp stamp = stamp_of(datagram, *parts.trailer);
  if (is_of_sessions) {
    on_session_message(parts.data, stamp, now);
    return std::nullopt;
  }
  return receive_recent(datagram, kind, parts, stamp, now);
}

/// Whether an equal datagram was accepted. To be called before the verification of the MAC. When
/// members are required, the sequence number proves nothing yet: any member can send any number in
/// the session of another one.
bool MessageReceiver::is_repeated(const Datagram& datagram, const wire::MacTrailer& trailer) const {
  if (authenticator_.members().are_required()) return recent_tags_.contains(trailer.tag);
  return filter_.is_received(stamp_of(datagram, trailer));
}

/// The checks after verification of the MAC: subscribed, recent.
std::optional<ReceivedMessage> MessageReceiver::receive_recent(const Datagram& datagram,
                                                               const ChannelKind* kind,
                                                               const DatagramParts& parts,
                                                               const SessionStamp& stamp,
                                                               const ReceiverTime& now) {
  const bool is_handled = datagram.is_whole() && is_handled_here(*kind);
  if (kind != nullptr && !is_handled && !wanted_(datagram.channel)) {
    skip(identity_of(datagram, parts));
    return std::nullopt;
  }
  if (!datagram.is_whole()) {
    if (!may_be_recent(stamp, now)) {
      authenticator_.count_stale();
      send_challenge(stamp, std::nullopt, now);
      return std::nullopt;
    }
    recent_tags_.insert(parts.trailer->tag);
  }
  const auto message =
      datagram.is_whole() ? pass(datagram.channel, parts.data) : reassemble(datagram, parts);
  if (!message) return std::nullopt;
  const auto accepted = accept(*message, stamp, now);
  if (accepted && accepted->is_accepted) recent_tags_.insert(parts.trailer->tag);
  return accepted;
}

bool MessageReceiver::may_be_recent(const SessionStamp& fragment, const ReceiverTime& now) const {
  return authenticator_.members().are_required() ? filter_.is_recent_for_any(fragment, now)
                                                 : filter_.is_recent(fragment, now);
}

/// Whether the session has proven that this complete message is recent. If not, challenges it.
bool MessageReceiver::is_recent(const ChannelKind& kind, const SessionStamp& stamp,
                                const wire::Signer& signer, const ReceiverTime& now) {
  if (!filter_.is_recent(stamp, now, signer)) {
    authenticator_.count_stale();
    send_challenge(stamp, signer, now);
    return false;
  }
  if (!kind.needs_challenge || !can_respond(signer)) return true;
  const bool has_responded = filter_.has_responded(stamp.session, signer);
  if (!has_responded || filter_.age(stamp, now, signer) > SessionReplayFilter::kSeemsOld)
    send_challenge(stamp, signer, now);
  return has_responded;
}

/// The last checks of a complete message: not received, recent, and its signer may send it. Only
/// then is it noted as received.
///
/// The signature of a command or reply does not contain its sequence number. When members are
/// required, such a message is therefore not noted: otherwise any member could send a recorded one
/// with a later number, and later commands would count as received. A repeated datagram is
/// rejected by its tag, and CommandReplayFilter rejects a repeated command.
std::optional<ReceivedMessage> MessageReceiver::accept(ReceivedMessage message,
                                                       const SessionStamp& stamp,
                                                       const ReceiverTime& now) {
  const ChannelKind& kind = *channels_.find(message.channel);
  const MemberSignatures& members = authenticator_.members();
  const wire::Signer signer = claimed_signer(kind, message.bytes);
  const bool is_noted = !kind.holds_own_mac || !members.are_required();
  if (is_noted && filter_.is_received(stamp, signer)) {
    authenticator_.count_replayed();
    return std::nullopt;
  }
  if (!is_recent(kind, stamp, signer, now)) return std::nullopt;
  if (kind.is_signed() && members.are_required()) {
    const VerifiedMessage verified =
        members.verify(message.bytes, origin_of(message.channel, stamp), kind,
                       channels_.owner_of(message.channel));
    message.bytes = verified.message;
    if (!verified.problem.empty()) {
      authenticator_.count_unsigned(verified.problem);
      message.is_accepted = false;
      return kind.is_shown_unverified ? std::optional(message) : std::nullopt;
    }
    if (kind.is_of_frame_keys) {
      filter_.note(stamp, now, signer);
      register_frame_key(message, signer, stamp, now);
      return std::nullopt;
    }
  }
  message.bytes = without_signature(kind, message.bytes);
  message.session = stamp.session;
  message.age = filter_.age(stamp, now, signer);
  message.sent = stamp.sent;
  message.sent_here = filter_.sent_here(stamp, now, signer);
  if (is_noted) filter_.note(stamp, now, signer);
  return message;
}

// --- live frames when members are required ------------------------------------------------------

/// Messages that need no subscription.
bool MessageReceiver::is_handled_here(const ChannelKind& kind) const {
  return kind.is_of_sessions || (kind.is_of_frame_keys && authenticator_.members().are_required());
}

/// Whether a frame key must verify this datagram: it is the first one of a frame, or a fragment
/// without a channel in a frame session.
bool MessageReceiver::is_of_frames(const ChannelKind* kind, const DatagramParts& parts,
                                   MonotonicInstant now) const {
  if (!parts.trailer || !authenticator_.members().are_required()) return false;
  return kind != nullptr ? kind->is_of_frames : frame_sessions_.has(parts.trailer->session, now);
}

/// A fragment without a channel, in a session from which nothing was accepted: before the key of a
/// frame session is announced, its fragments cannot be told from forgeries.
bool MessageReceiver::may_be_frame(const ChannelKind* kind, const DatagramParts& parts) const {
  return kind == nullptr && parts.trailer && authenticator_.members().are_required() &&
         !filter_.contains(parts.trailer->session);
}

/// Costs one hash. Only when nodes announce the same session number, the key of each is tried.
std::optional<ReceivedMessage> MessageReceiver::receive_frame(const Datagram& datagram,
                                                              const ChannelKind* kind,
                                                              const DatagramParts& parts,
                                                              const ReceiverTime& now) {
  bool is_known = false, has_key = false, is_received = false;
  for (const FrameSession& session : frame_sessions_.find(parts.trailer->session)) {
    if (!session.is_valid(now.monotonic)) continue;
    is_known = true;
    if (session.mac == nullptr) continue;
    has_key = true;
    if (frame_filter_.is_received({session.id, datagram.sequence, parts.trailer->sent})) {
      is_received = true;
    } else if (session.mac->verify(datagram.head, parts.data, *parts.trailer)) {
      return receive_authentic_frame(datagram, parts, session, now);
    }
  }
  const bool is_first = kind != nullptr;
  if (is_received) {
    if (is_first) authenticator_.count_replayed();
  } else if (has_key) {
    authenticator_.count_forged_frame();
  } else if (!is_known) {
    count_frame_without_key(datagram, parts, now.monotonic);
  } else if (is_first && wanted_(datagram.channel)) {
    authenticator_.count_unkeyed();
  }
  return std::nullopt;
}

std::optional<ReceivedMessage> MessageReceiver::receive_authentic_frame(const Datagram& datagram,
                                                                        const DatagramParts& parts,
                                                                        const FrameSession& session,
                                                                        const ReceiverTime& now) {
  const SessionStamp stamp{session.id, datagram.sequence, parts.trailer->sent};
  if (!frame_filter_.is_recent(stamp, now)) {
    authenticator_.count_stale();
    return std::nullopt;
  }
  const bool is_first = datagram.number == 0;
  const uint64_t sender = uint64_t{session.id} << 32 | session.number;
  if (is_first && (!may_send(session, datagram.channel) || !wanted_(datagram.channel))) {
    frame_filter_.note(stamp, now);
    reassembly_.drop(identity_of(datagram, parts, sender));
    return std::nullopt;
  }
  const auto message = datagram.is_whole() ? pass(datagram.channel, parts.data)
                                           : reassemble(datagram, parts, sender);
  if (message) frame_filter_.note(stamp, now);
  return message;
}

/// Whether the node of the session owns the camera and is still a member.
bool MessageReceiver::may_send(const FrameSession& session, std::string_view channel) {
  const std::string_view owner = channels_.owner_of(channel);
  if (owner != session.node) {
    authenticator_.count_unsigned(std::string(channel) + " of member " + session.node +
                                  " is rejected: only " + std::string(owner) + " may send it");
    return false;
  }
  if (authenticator_.members().has_node(session.node, session.signer)) return true;
  authenticator_.count_unsigned(std::string(channel) +
                                " is rejected: the member list here has no node " + session.node +
                                " with the key that announced it");
  return false;
}

/// Counts the first datagram of a frame of an unknown session. A holder of the studio key that
/// sends frames without a frame key is reported. Otherwise the announcement has perhaps not arrived
/// yet.
void MessageReceiver::count_frame_without_key(const Datagram& datagram, const DatagramParts& parts,
                                              MonotonicInstant now) {
  if (!wanted_(datagram.channel)) return;
  if (is_authentic(datagram, parts, now)) {
    authenticator_.count_unsigned(
        std::string(datagram.channel) + " with the MAC of the studio key is rejected: only " +
        std::string(channels_.owner_of(datagram.channel)) + " may send it, with its frame key");
  } else {
    authenticator_.count_unkeyed();
  }
}

void MessageReceiver::register_frame_key(const ReceivedMessage& message, const wire::Signer& signer,
                                         const SessionStamp& stamp, const ReceiverTime& now) {
  const auto announced = wire::decode<wire::FrameKeyMessage>(message.bytes);
  if (!announced) {
    ++malformed_;
    return;
  }
  const auto open = [&]() -> std::shared_ptr<const wire::DatagramMac> {
    const auto key = authenticator_.members().open(*announced);
    return key ? std::make_shared<const wire::DatagramMac>(key->mac()) : nullptr;
  };
  const uint32_t id = frame_sessions_.announce(channels_.owner_of(message.channel),
                                               announced->session, *signer, now.monotonic, open);
  frame_filter_.accept({id, announced->newest, stamp.sent}, now, Duration::zero());
}

/// The key id in the signature of a message, not verified, when members are required.
wire::Signer MessageReceiver::claimed_signer(const ChannelKind& kind,
                                             std::span<const uint8_t> message) const {
  if (!authenticator_.members().are_required()) return std::nullopt;
  if (!kind.is_signed() && !kind.holds_own_mac) return std::nullopt;
  const auto split = wire::split_signature(message);
  return split ? wire::Signer(split->key_id) : std::nullopt;
}

/// False when members are required and none has this key: the message will be rejected.
bool MessageReceiver::can_respond(const wire::Signer& signer) const {
  const MemberSignatures& members = authenticator_.members();
  return !members.are_required() || (signer && members.contains(*signer));
}

// --- sessions -----------------------------------------------------------------------------------

void MessageReceiver::drop_old_challenges() {
  if (std::exchange(forgotten_, filter_.forgotten()) != filter_.forgotten()) challenges_ = {};
}

void MessageReceiver::send_challenge(const SessionStamp& stamp, const wire::Signer& signer,
                                     const ReceiverTime& now) {
  drop_old_challenges();
  const auto nonce = challenges_.issue(stamp.session, now.monotonic, signer);
  if (!nonce) return;
  sessions_.send({.sent = {}, .session = stamp.session, .newest = 0, .nonce = *nonce});
}

void MessageReceiver::on_session_message(std::span<const uint8_t> bytes, const SessionStamp& stamp,
                                         const ReceiverTime& now) {
  const auto message =
      wire::decode<wire::SessionMessage>(without_signature(*kind_of(wire::kSessionChannel), bytes));
  if (!message) {
    ++malformed_;
  } else if (message->is_answer) {
    on_response(*message, bytes, stamp, now);
  } else {
    respond(*message, now.monotonic);
  }
}

void MessageReceiver::on_response(const wire::SessionMessage& response,
                                  std::span<const uint8_t> bytes, const SessionStamp& stamp,
                                  const ReceiverTime& now) {
  drop_old_challenges();
  const auto signer = verified_signer(response, bytes, stamp, now.monotonic);
  if (!signer) return;
  const auto waited =
      challenges_.pop_matching(response.session, response.nonce, now.monotonic, *signer);
  if (!waited) return;
  filter_.accept({response.session, response.newest, stamp.sent}, now, *waited, *signer);
  const Duration ahead = stamp.sent - now.realtime;
  if (std::chrono::abs(ahead) > SessionReplayFilter::kAhead)
    authenticator_.report(clocks_differ(ahead));
}

/// The signer of a response. Empty when members are required and the signature is missing or wrong.
/// Responses without a pending challenge are rejected before the signature is verified.
std::optional<wire::Signer> MessageReceiver::verified_signer(const wire::SessionMessage& response,
                                                             std::span<const uint8_t> bytes,
                                                             const SessionStamp& stamp,
                                                             MonotonicInstant now) {
  if (!authenticator_.members().are_required()) return wire::Signer{};
  const auto split = wire::split_signature(bytes);
  const wire::Signer claimed = split ? wire::Signer(split->key_id) : std::nullopt;
  if (!challenges_.is_pending(response.session, response.nonce, now, claimed)) return std::nullopt;
  const VerifiedMessage verified = authenticator_.members().verify(
      bytes, origin_of(wire::kSessionChannel, stamp), *kind_of(wire::kSessionChannel), "");
  if (verified.problem.empty()) return verified.signer;
  authenticator_.count_unsigned(verified.problem);
  return std::nullopt;
}

/// Responds at most kMaxResponses times a second. A replayed challenge yields no secret.
void MessageReceiver::respond(const wire::SessionMessage& challenge, MonotonicInstant now) {
  const auto newest = sessions_.newest_of_own(challenge.session);
  if (!newest) return;
  if (now - responses_since_ >= std::chrono::seconds(1)) {
    responses_since_ = now;
    responses_ = 0;
  }
  if (responses_++ >= kMaxResponses) return;
  wire::SessionMessage response = challenge;
  response.newest = *newest;
  response.is_answer = true;
  sessions_.send(response);
}

std::optional<ReceivedMessage> MessageReceiver::receive_anything(const Datagram& datagram,
                                                                 const ChannelKind* kind,
                                                                 uint64_t source) {
  const DatagramParts parts = split_trailer(datagram);
  const MessageIdentity identity = identity_of(datagram, parts, source);
  if (kind != nullptr && !wanted_(datagram.channel)) {
    skip(identity);
    return std::nullopt;
  }
  if (kind == nullptr && skipped_.contains(identity)) return std::nullopt;
  auto message = datagram.is_whole() ? pass(datagram.channel, parts.data)
                                     : reassemble(datagram, parts, source);
  if (message) {
    message->bytes = without_signature(*channels_.find(message->channel), message->bytes);
    message->session = source;
  }
  return message;
}

bool MessageReceiver::is_authentic(const Datagram& datagram, const DatagramParts& parts,
                                   MonotonicInstant now) const {
  return parts.trailer && authenticator_.verify(datagram.head, parts.data, *parts.trailer, now);
}

std::optional<ReceivedMessage> MessageReceiver::reassemble(const Datagram& datagram,
                                                           const DatagramParts& parts,
                                                           uint64_t sender) {
  // V3D sends no fragment whose sizes contradict its trailer.
  const MessageIdentity of = identity_of(datagram, parts, sender);
  if (datagram.message_size < wire::kMacTrailerSize ||
      datagram.offset + parts.data.size() > of.size) {
    ++malformed_;
    return std::nullopt;
  }
  const auto message = reassembly_.add({.of = of,
                                        .number = datagram.number,
                                        .offset = datagram.offset,
                                        .channel = datagram.channel,
                                        .data = parts.data});
  incomplete_ = reassembly_.given_up() + reassembly_.inconsistent();
  if (!message) return std::nullopt;
  return pass(message->channel, message->bytes);
}

std::optional<ReceivedMessage> MessageReceiver::pass(std::string_view channel,
                                                     std::span<const uint8_t> bytes) {
  if (!channels_.use(channel)) {
    ++foreign_;
    return std::nullopt;
  }
  return ReceivedMessage{channel, bytes};
}

void MessageReceiver::skip(const MessageIdentity& message) {
  skipped_.insert(message);
  reassembly_.drop(message);
}

DatagramCounts MessageReceiver::counts() const {
  return {.malformed = malformed_,
          .foreign = foreign_,
          .oversized = oversized_,
          .incomplete = incomplete_};
}

}  // namespace v3d::bus
