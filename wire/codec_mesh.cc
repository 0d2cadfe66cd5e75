#include <algorithm>
#include <utility>

#include "v3d/mesh_t.hpp"
#include "v3d/shard_mesh_t.hpp"
#include "v3d/shard_t.hpp"
#include "wire/codec.h"
#include "wire/packing.h"

namespace v3d::wire {
namespace {

constexpr Layout kMeshLayout = "qqsqqqqinnS0B1";
constexpr Layout kShardMeshLayout = "qqsqqqqinnS0B1s";
constexpr Layout kShardLayout = "qqssqqqqnD0";

mesh_t wire_of(const MeshMessage& m) {
  mesh_t w;
  w.utime = utime_of(m.sent);
  w.seq = m.seq;
  w.take = m.take;
  w.pulse = m.pulse;
  w.t_edge_ns = to_ns(m.pulse_edge);
  w.silhouette_iou = m.silhouette_iou;
  w.coverage = m.coverage;
  w.cameras = m.cameras;
  w.n_missing = static_cast<int32_t>(m.missing.size());
  w.missing = m.missing;
  w.compact = m.compact;
  w.n_compact = static_cast<int32_t>(w.compact.size());
  return w;
}

std::optional<MeshMessage> mesh_of(mesh_t&& w) {
  const auto sent = instant_of(w.utime);
  if (!sent || w.seq < 0 || w.pulse < 0) return std::nullopt;
  const auto is_fraction = [](double value) { return value >= 0 && value <= 1; };
  if (!is_fraction(w.silhouette_iou) || !is_fraction(w.coverage) || w.cameras < 0)
    return std::nullopt;
  return MeshMessage{.sent = *sent,
                     .seq = w.seq,
                     .take = std::move(w.take),
                     .pulse = w.pulse,
                     .pulse_edge = from_ns<Realtime>(w.t_edge_ns),
                     .silhouette_iou = w.silhouette_iou,
                     .coverage = w.coverage,
                     .cameras = w.cameras,
                     .missing = std::move(w.missing),
                     .compact = std::move(w.compact)};
}

}  // namespace

Bytes encode(const MeshMessage& m) { return pack(wire_of(m)); }

template <>
std::optional<MeshMessage> decode(std::span<const uint8_t> bytes) {
  auto w = unpack<mesh_t>(kMeshLayout, bytes);
  if (!w) return std::nullopt;
  return mesh_of(*std::move(w));
}

Bytes encode(const ShardMeshMessage& m) {
  shard_mesh_t w;
  w.mesh = wire_of(m);
  w.node = m.node;
  return pack(w);
}

template <>
std::optional<ShardMeshMessage> decode(std::span<const uint8_t> bytes) {
  auto w = unpack<shard_mesh_t>(kShardMeshLayout, bytes);
  if (!w) return std::nullopt;
  auto mesh = mesh_of(std::move(w->mesh));
  if (!mesh) return std::nullopt;
  ShardMeshMessage message;
  static_cast<MeshMessage&>(message) = *std::move(mesh);
  message.node = std::move(w->node);
  return message;
}

Bytes encode(const ShardMessage& m) {
  shard_t w;
  w.utime = utime_of(m.sent);
  w.seq = m.seq;
  w.take = m.take;
  w.node = m.node;
  w.first = m.first;
  w.done = m.done;
  w.ordered = m.ordered;
  w.shown = m.shown;
  w.given_up = m.given_up;
  w.n_given_up = static_cast<int32_t>(w.given_up.size());
  return pack(w);
}

template <>
std::optional<ShardMessage> decode(std::span<const uint8_t> bytes) {
  auto w = unpack<shard_t>(kShardLayout, bytes);
  if (!w) return std::nullopt;
  const auto sent = instant_of(w->utime);
  const bool valid =
      w->seq >= 0 && std::min({w->first, w->done, w->ordered, w->shown}) >= -1 &&
      std::all_of(w->given_up.begin(), w->given_up.end(), [](int64_t pulse) { return pulse >= 0; });
  if (!sent || !valid) return std::nullopt;
  return ShardMessage{.sent = *sent,
                      .seq = w->seq,
                      .take = std::move(w->take),
                      .node = std::move(w->node),
                      .first = w->first,
                      .done = w->done,
                      .ordered = w->ordered,
                      .shown = w->shown,
                      .given_up = std::move(w->given_up)};
}

}  // namespace v3d::wire
