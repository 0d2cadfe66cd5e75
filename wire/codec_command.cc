#include <algorithm>
#include <cmath>

#include "v3d/command_t.hpp"
#include "v3d/reply_t.hpp"
#include "wire/codec.h"
#include "wire/packing.h"

namespace v3d {
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

}  // namespace v3d
