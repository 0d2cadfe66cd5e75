#include "daemon/recond/shared_take.h"

#include <utility>

#include "wire/messages.h"

namespace v3d::recond {
namespace {

/// A received mesh ends the wait at once. Other messages may wait that long.
constexpr Duration kPollPeriod = std::chrono::milliseconds(50);
constexpr Duration kStatusPeriod = std::chrono::milliseconds(100);
/// Holds the meshes that arrive while this thread waits for a processor.
constexpr size_t kMeshQueue = 256;
constexpr size_t kStatusQueue = 256;

}  // namespace

SharedTake::SharedTake(const Shard::Setup& setup, bus::Bus& bus, Receivers receivers)
    : node_(setup.node),
      bus_(bus),
      receivers_(std::move(receivers)),
      statuses_(bus, std::string(wire::kShardPrefix) + ".*", kStatusQueue),
      meshes_(bus, std::string(wire::kShardMeshPrefix) + ".*", kMeshQueue),
      published_(bus, wire::kMeshChannel, kMeshQueue),
      shard_(setup, Monotonic::now()),
      next_status_(Monotonic::now()),
      thread_([this] { run(); }) {}

void SharedTake::stop() {
  stopping_ = true;
  if (thread_.joinable()) thread_.join();
}

void SharedTake::run() {
  while (!stopping_) {
    heartbeat_.beat();
    auto mesh = meshes_.wait(Monotonic::now() + kPollPeriod);
    const std::lock_guard lock(mutex_);
    for (; mesh; mesh = meshes_.wait(Monotonic::now())) {
      if (mesh->node != node_) shard_.on_mesh(std::move(*mesh));
    }
    receive();
    process();
    send_status();
  }
}

void SharedTake::receive() {
  while (const auto mesh = published_.wait(Monotonic::now())) {
    shard_.on_published(*mesh);
    // If this node publishes the next mesh, it continues this sequence.
    published_seq_ = std::max(published_seq_, mesh->seq + 1);
  }
  while (const auto status = statuses_.wait(Monotonic::now())) shard_.on_status(*status);
}

void SharedTake::process() {
  std::vector<int64_t> given_up;
  {
    const std::lock_guard lock(given_up_mutex_);
    given_up.swap(given_up_);
  }
  for (const int64_t pulse : given_up) shard_.give_up(pulse);
  shard_.advance(Monotonic::now());
  if (groups_ != shard_.frame_groups() && receivers_.on_frame_groups(shard_.frame_groups())) {
    groups_ = shard_.frame_groups();
  }
  for (recon::ReadySet& set : shard_.pop_work()) receivers_.on_work(std::move(set));
  for (wire::MeshMessage& mesh : shard_.pop_to_publish()) {
    mesh.seq = published_seq_++;
    mesh.sent = Realtime::now();
    bus_.publish_authenticated(wire::kMeshChannel, encode(mesh));
  }
  for (const wire::MeshMessage& mesh : shard_.pop_ordered()) receivers_.on_ordered(mesh);
}

void SharedTake::send_status() {
  const MonotonicInstant now = Monotonic::now();
  if (now < next_status_) return;
  next_status_ = now + kStatusPeriod;
  wire::ShardMessage status = shard_.status();
  status.sent = Realtime::now();
  status.seq = status_seq_++;
  bus_.publish_authenticated(wire::shard_channel(node_), encode(status));
}

void SharedTake::on_pulse(int64_t pulse) {
  const std::lock_guard lock(mutex_);
  shard_.on_pulse(pulse);
}

void SharedTake::add(recon::ReadySet set) {
  const std::lock_guard lock(mutex_);
  shard_.on_set(std::move(set));
  process();
}

bool SharedTake::begin(int64_t pulse) {
  const std::lock_guard lock(mutex_);
  return shard_.begin(pulse);
}

void SharedTake::add_mesh(wire::MeshMessage mesh) {
  wire::ShardMeshMessage message;
  static_cast<wire::MeshMessage&>(message) = std::move(mesh);
  message.node = node_;
  message.seq = mesh_seq_++;
  bus_.publish_authenticated(wire::shard_mesh_channel(node_), encode(message));
  const std::lock_guard lock(mutex_);
  shard_.on_own_mesh(std::move(static_cast<wire::MeshMessage&>(message)));
  process();
}

void SharedTake::give_up(int64_t pulse) {
  const std::lock_guard lock(given_up_mutex_);
  given_up_.push_back(pulse);
}

ShardCounts SharedTake::counts() const {
  const std::lock_guard lock(mutex_);
  return shard_.counts();
}

std::vector<int64_t> SharedTake::without_mesh() const {
  const std::lock_guard lock(mutex_);
  return shard_.without_mesh();
}

bool SharedTake::is_settled() const {
  const std::lock_guard lock(mutex_);
  return shard_.is_settled();
}

int64_t SharedTake::undecodable() const {
  return statuses_.counts().undecodable + meshes_.counts().undecodable +
         published_.counts().undecodable;
}

}  // namespace v3d::recond
