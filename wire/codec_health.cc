#include "v3d/event_t.hpp"
#include "v3d/health_t.hpp"
#include "v3d/pulse_t.hpp"
#include "wire/codec.h"
#include "wire/packing.h"

namespace v3d::wire {
namespace {

constexpr Layout kHealthLayout = "qqsssbssnS0D0nS1S1";
constexpr Layout kEventLayout = "qqsbss";

}  // namespace

Bytes encode(const HealthMessage& m) {
  health_t w;
  w.utime = utime_of(m.sent);
  w.seq = m.seq;
  w.node = m.node;
  w.program = m.program;
  w.version = m.version;
  w.state = static_cast<int8_t>(m.state);
  w.take = m.take;
  w.text = m.text;
  w.n_values = static_cast<int32_t>(m.values.size());
  for (const auto& [value_name, value] : m.values) {
    w.names.push_back(value_name);
    w.values.push_back(value);
  }
  w.n_texts = static_cast<int32_t>(m.texts.size());
  for (const auto& [text_name, text] : m.texts) {
    w.text_names.push_back(text_name);
    w.texts.push_back(text);
  }
  return pack(w);
}

template <>
std::optional<HealthMessage> decode(std::span<const uint8_t> bytes) {
  auto w = unpack<health_t>(kHealthLayout, bytes);
  if (!w) return std::nullopt;
  const auto sent = instant_of(w->utime);
  const auto state = enumerator(w->state, NodeState::kFault);
  if (!sent || !state || w->seq < 0) return std::nullopt;
  HealthMessage m{.sent = *sent,
                  .seq = w->seq,
                  .node = w->node,
                  .program = w->program,
                  .version = w->version,
                  .state = *state,
                  .take = w->take,
                  .text = std::move(w->text),
                  .values = {},
                  .texts = {}};
  for (size_t i = 0; i < w->names.size(); ++i) m.values[w->names[i]] = w->values[i];
  for (size_t i = 0; i < w->texts.size(); ++i) m.texts[w->text_names[i]] = w->texts[i];
  return m;
}

Bytes encode(const EventMessage& m) {
  event_t w;
  w.utime = utime_of(m.sent);
  w.seq = m.seq;
  w.node = m.node;
  w.severity = static_cast<int8_t>(m.severity);
  w.subject = m.subject;
  w.text = m.text;
  return pack(w);
}

template <>
std::optional<EventMessage> decode(std::span<const uint8_t> bytes) {
  auto w = unpack<event_t>(kEventLayout, bytes);
  if (!w) return std::nullopt;
  const auto sent = instant_of(w->utime);
  const auto severity = enumerator(w->severity, Severity::kAlarm);
  if (!sent || !severity || w->seq < 0) return std::nullopt;
  return EventMessage{.sent = *sent,
                      .seq = w->seq,
                      .node = w->node,
                      .severity = *severity,
                      .subject = w->subject,
                      .text = std::move(w->text)};
}

namespace {

constexpr Layout kPulseLayout = "qqsqqq";

}  // namespace

Bytes encode(const PulseMessage& m) {
  pulse_t w;
  w.utime = utime_of(m.sent);
  w.seq = m.seq;
  w.take = m.take;
  w.pulse = m.pulse;
  w.t_edge_ns = to_ns(m.edge);
  w.t_edge_monotonic_ns = to_ns(m.edge_monotonic);
  return pack(w);
}

template <>
std::optional<PulseMessage> decode(std::span<const uint8_t> bytes) {
  const auto w = unpack<pulse_t>(kPulseLayout, bytes);
  if (!w) return std::nullopt;
  const auto sent = instant_of(w->utime);
  if (!sent || w->seq < 0 || w->pulse < 0) return std::nullopt;
  return PulseMessage{.sent = *sent,
                      .seq = w->seq,
                      .take = w->take,
                      .pulse = w->pulse,
                      .edge = from_ns<Realtime>(w->t_edge_ns),
                      .edge_monotonic = from_ns<Monotonic>(w->t_edge_monotonic_ns)};
}

}  // namespace v3d::wire
