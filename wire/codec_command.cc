#include <algorithm>
#include <cmath>

#include "v3d/command_t.hpp"
#include "v3d/frame_key_t.hpp"
#include "v3d/reply_t.hpp"
#include "v3d/session_t.hpp"
#include "wire/codec.h"
#include "wire/packing.h"

namespace v3d::wire {
namespace {

constexpr Layout kCommandLayout = "qsqb?sqqnnS0S1D1m";
constexpr Layout kReplyLayout = "qssqqqbsssm";

}  // namespace

Bytes encode(const CommandMessage& m) {
  command_t w;
  w.utime = utime_of(m.sent);
  w.sender = m.sender;
  w.counter = m.counter;
  w.verb = static_cast<int8_t>(m.verb);
  w.own_only = m.own_only;
  w.take = m.take;
  w.rate_hz = m.rate_hz;
  w.pulses = m.pulses;
  w.n_allow_missing = static_cast<int32_t>(m.allow_missing.size());
  w.allow_missing = m.allow_missing;
  w.n_to = static_cast<int32_t>(m.to.size());
  w.to = m.to;
  w.nonces = m.nonces;
  w.nonces.resize(m.to.size());
  std::fill(std::begin(w.mac), std::end(w.mac), uint8_t{0});
  return pack(w);
}

template <>
std::optional<CommandMessage> decode(std::span<const uint8_t> bytes) {
  auto w = unpack<command_t>(kCommandLayout, bytes);
  if (!w) return std::nullopt;
  const auto sent = instant_of(w->utime);
  const auto verb = enumerator(w->verb, CommandVerb::kCheck);
  const bool valid = w->counter >= 0 && w->pulses >= 0 && std::isfinite(w->rate_hz) &&
                     w->rate_hz >= 0 && !w->sender.empty();
  if (!sent || !verb || !valid) return std::nullopt;
  return CommandMessage{.sent = *sent,
                        .sender = w->sender,
                        .counter = w->counter,
                        .verb = *verb,
                        .own_only = w->own_only != 0,
                        .take = w->take,
                        .rate_hz = w->rate_hz,
                        .pulses = w->pulses,
                        .allow_missing = std::move(w->allow_missing),
                        .to = std::move(w->to),
                        .nonces = std::move(w->nonces)};
}

Bytes encode(const ReplyMessage& m) {
  reply_t w;
  w.utime = utime_of(m.sent);
  w.node = m.node;
  w.command_sender = m.command_sender;
  w.command_counter = m.command_counter;
  w.command_utime = utime_of(m.command_sent);
  w.nonce = m.nonce;
  w.outcome = static_cast<int8_t>(m.outcome);
  w.take = m.take;
  w.text = m.text;
  w.detail = m.detail;
  std::fill(std::begin(w.mac), std::end(w.mac), uint8_t{0});
  return pack(w);
}

template <>
std::optional<ReplyMessage> decode(std::span<const uint8_t> bytes) {
  auto w = unpack<reply_t>(kReplyLayout, bytes);
  if (!w) return std::nullopt;
  const auto sent = instant_of(w->utime);
  const auto command_sent = instant_of(w->command_utime);
  const auto outcome = enumerator(w->outcome, ReplyMessage::Outcome::kNonceMissing);
  if (!sent || !command_sent || !outcome || w->command_counter < 0) return std::nullopt;
  return ReplyMessage{.sent = *sent,
                      .node = w->node,
                      .command_sender = w->command_sender,
                      .command_counter = w->command_counter,
                      .command_sent = *command_sent,
                      .nonce = w->nonce,
                      .outcome = *outcome,
                      .take = std::move(w->take),
                      .text = std::move(w->text),
                      .detail = std::move(w->detail)};
}

namespace {

constexpr Layout kSessionLayout = "qiiq?";

}  // namespace

Bytes encode(const SessionMessage& m) {
  session_t w;
  w.utime = utime_of(m.sent);
  w.session = static_cast<int32_t>(m.session);
  w.newest = static_cast<int32_t>(m.newest);
  w.nonce = m.nonce;
  w.is_answer = m.is_answer;
  return pack(w);
}

template <>
std::optional<SessionMessage> decode(std::span<const uint8_t> bytes) {
  const auto w = unpack<session_t>(kSessionLayout, bytes);
  if (!w) return std::nullopt;
  const auto sent = instant_of(w->utime);
  if (!sent || w->nonce == 0) return std::nullopt;
  return SessionMessage{.sent = *sent,
                        .session = static_cast<uint32_t>(w->session),
                        .newest = static_cast<uint32_t>(w->newest),
                        .nonce = w->nonce,
                        .is_answer = w->is_answer != 0};
}

namespace {

constexpr Layout kFrameKeyLayout = "qiinB0";
constexpr size_t kIdSize = std::tuple_size_v<decltype(SealedFrameKey::recipient)>;
constexpr size_t kSealedSize = std::tuple_size_v<decltype(SealedFrameKey::sealed)>;
constexpr size_t kEntrySize = kIdSize + kSealedSize;

}  // namespace

Bytes encode(const FrameKeyMessage& m) {
  frame_key_t w;
  w.utime = utime_of(m.sent);
  w.session = static_cast<int32_t>(m.session);
  w.newest = static_cast<int32_t>(m.newest);
  for (const SealedFrameKey& key : m.keys) {
    w.keys.insert(w.keys.end(), key.recipient.begin(), key.recipient.end());
    w.keys.insert(w.keys.end(), key.sealed.begin(), key.sealed.end());
  }
  w.n_keys = static_cast<int32_t>(w.keys.size());
  return pack(w);
}

template <>
std::optional<FrameKeyMessage> decode(std::span<const uint8_t> bytes) {
  const auto w = unpack<frame_key_t>(kFrameKeyLayout, bytes);
  if (!w) return std::nullopt;
  const auto sent = instant_of(w->utime);
  const size_t size = w->keys.size();
  if (!sent || size % kEntrySize != 0 || size > kMaxFrameKeyRecipients * kEntrySize) {
    return std::nullopt;
  }
  FrameKeyMessage m{.sent = *sent,
                    .session = static_cast<uint32_t>(w->session),
                    .newest = static_cast<uint32_t>(w->newest),
                    .keys = std::vector<SealedFrameKey>(size / kEntrySize)};
  const uint8_t* at = w->keys.data();
  for (SealedFrameKey& key : m.keys) {
    std::copy_n(at, kIdSize, key.recipient.begin());
    std::copy_n(at + kIdSize, kSealedSize, key.sealed.begin());
    at += kEntrySize;
  }
  return m;
}

}  // namespace v3d::wire
