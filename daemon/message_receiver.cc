#include "daemon/message_receiver.h"

#include <utility>

namespace v3d {
namespace {

constexpr char kMalformed[] =
    "malformed datagrams are rejected: a stranger, or a broken program on the studio's network";
constexpr char kOversized[] =
    "messages longer than any of their channel are rejected: a stranger, or another version of V3D";

MessageIdentity identity_of(const Datagram& datagram, const DatagramParts& parts, uint64_t sender) {
  const size_t trailer = parts.trailer ? kMacTrailerSize : 0;
  return {.sender = sender,
          .sequence = datagram.sequence,
          .sent_ns = parts.trailer ? to_ns(parts.trailer->sent) : 0,
          .size = datagram.message_size - static_cast<uint32_t>(trailer),
          .count = datagram.count};
}

}  // namespace

MessageReceiver::MessageReceiver(ChannelList channels, MessageSeal& seal, Wanted wanted)
    : channels_(std::move(channels)), seal_(seal), wanted_(std::move(wanted)) {}

std::optional<ReceivedMessage> MessageReceiver::receive(std::span<const uint8_t> bytes,
                                                        uint64_t source, RealtimeInstant now) {
  const auto datagram = parse_datagram(bytes);
  if (!datagram) {
    ++malformed_;
    seal_.report(kMalformed);
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
      seal_.report(kOversized);
      return std::nullopt;
    }
  }
  return seal_.is_required() ? receive_authentic(*datagram, kind, now)
                             : receive_anything(*datagram, kind, source);
}

std::optional<ReceivedMessage> MessageReceiver::receive_authentic(const Datagram& datagram,
                                                                  const ChannelKind* kind,
                                                                  RealtimeInstant now) {
  const bool is_first = kind != nullptr;
  if (datagram.is_whole() && !wanted_(datagram.channel)) return std::nullopt;
  if (datagram.is_whole() && kind->holds_own_mac) return pass(datagram.channel, datagram.data);
  const DatagramParts parts = split_trailer(datagram);
  if (parts.trailer &&
      windows_.is_received(parts.trailer->session, datagram.sequence, parts.trailer->sent)) {
    if (is_first) seal_.count_replayed();
    return std::nullopt;
  }
  if (!is_authentic(datagram, parts)) {
    seal_.count_forged();
    if (!datagram.is_whole() || !kind->is_shown_unverified) return std::nullopt;
    return ReceivedMessage{datagram.channel, parts.data, false};
  }
  const MacTrailer& trailer = *parts.trailer;
  if (!is_recent(trailer, now)) return std::nullopt;
  if (is_first && !wanted_(datagram.channel)) {
    windows_.note(trailer.session, datagram.sequence, trailer.sent);
    reassembly_.drop(identity_of(datagram, parts, trailer.session));
    return std::nullopt;
  }
  const auto message = datagram.is_whole() ? pass(datagram.channel, parts.data)
                                           : reassemble(datagram, parts, trailer.session);
  if (message) windows_.note(trailer.session, datagram.sequence, trailer.sent);
  return message;
}

std::optional<ReceivedMessage> MessageReceiver::receive_anything(const Datagram& datagram,
                                                                 const ChannelKind* kind,
                                                                 uint64_t source) {
  const Sequence sequence = {source, datagram.sequence};
  const DatagramParts parts = split_trailer(datagram);
  if (kind != nullptr && !wanted_(datagram.channel)) {
    skip(sequence);
    reassembly_.drop(identity_of(datagram, parts, source));
    return std::nullopt;
  }
  if (datagram.is_whole()) {
    return pass(datagram.channel, kind->holds_own_mac ? datagram.data : parts.data);
  }
  if (kind == nullptr && is_skipped(sequence)) return std::nullopt;
  return reassemble(datagram, parts, source);
}

bool MessageReceiver::is_authentic(const Datagram& datagram, const DatagramParts& parts) const {
  const auto mac = seal_.mac();
  return mac && parts.trailer && mac->verify(datagram.head, parts.data, *parts.trailer);
}

bool MessageReceiver::is_recent(const MacTrailer& trailer, RealtimeInstant now) {
  const Duration age = now - trailer.sent;
  if (age <= NewsGate::kOldest && -age <= NewsGate::kAhead) return true;
  seal_.count_stale(age);
  return false;
}

std::optional<ReceivedMessage> MessageReceiver::reassemble(const Datagram& datagram,
                                                           const DatagramParts& parts,
                                                           uint64_t sender) {
  // A trailer that is none, by the size of its message, belongs to no fragment of ours.
  const MessageIdentity of = identity_of(datagram, parts, sender);
  if (datagram.message_size < kMacTrailerSize || datagram.offset + parts.data.size() > of.size) {
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

bool MessageReceiver::is_skipped(const Sequence& message) const {
  return skipped_[message.sender % skipped_.size()] == message;
}

void MessageReceiver::skip(const Sequence& message) {
  skipped_[message.sender % skipped_.size()] = message;
}

DatagramCounts MessageReceiver::counts() const {
  return {.malformed = malformed_,
          .foreign = foreign_,
          .oversized = oversized_,
          .incomplete = incomplete_};
}

}  // namespace v3d
