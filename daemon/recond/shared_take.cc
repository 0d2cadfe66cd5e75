#include "daemon/recond/shared_take.h"

#include <utility>

#include "wire/channels.h"

namespace v3d {
namespace {

/// What is heard of meshes ends the wait at once; the rest is a matter of a tenth of a second.
constexpr Duration kTurn = std::chrono::milliseconds(50);
constexpr Duration kWordEvery = std::chrono::milliseconds(100);
/// Meshes that wait to be taken, while this thread has to wait for a processor.
constexpr size_t kMeshQueue = 256;
constexpr size_t kWordQueue = 256;

}  // namespace

SharedTake::SharedTake(const Shard::Setup& setup, Bus& bus, Receivers receivers)
    : me_(setup.me),
      bus_(bus),
      receivers_(std::move(receivers)),
      words_(bus, std::string(kShardPrefix) + ".*", kWordQueue),
      meshes_(bus, std::string(kShardMeshPrefix) + ".*", kMeshQueue),
      shown_(bus, kMeshChannel, kMeshQueue),
      shard_(setup),
      next_word_(Monotonic::now()),
      thread_([this] { run(); }) {}

void SharedTake::end() {
  stopping_ = true;
  if (thread_.joinable()) thread_.join();
}

void SharedTake::run() {
  while (!stopping_) {
    listening_.beat();
    auto mesh = meshes_.wait(Monotonic::now() + kTurn);
    const std::lock_guard lock(mutex_);
    for (; mesh; mesh = meshes_.wait(Monotonic::now())) {
      if (mesh->node != me_) shard_.hear(std::move(*mesh));
    }
    hear_all();
    act();
    say();
  }
}

void SharedTake::hear_all() {
  while (const auto shown = shown_.wait(Monotonic::now())) {
    shard_.heard_shown(*shown);
    // Who shows the next counts on from here.
    shown_seq_ = std::max(shown_seq_, shown->seq + 1);
  }
  while (const auto word = words_.wait(Monotonic::now())) shard_.hear(*word);
}

void SharedTake::act() {
  std::vector<int64_t> given_up;
  {
    const std::lock_guard lock(given_up_mutex_);
    given_up.swap(given_up_);
  }
  for (const int64_t pulse : given_up) shard_.gave_up(pulse);
  shard_.turn(Monotonic::now());
  if (heard_ != shard_.frame_groups()) {
    heard_ = shard_.frame_groups();
    receivers_.hear(*heard_);
  }
  for (ReadySet& set : shard_.take_work()) receivers_.work(std::move(set));
  for (MeshMessage& mesh : shard_.take_to_show()) {
    mesh.seq = shown_seq_++;
    mesh.sent = Realtime::now();
    bus_.publish_sealed(kMeshChannel, encode(mesh));
  }
  for (const MeshMessage& mesh : shard_.take_ordered()) receivers_.ordered(mesh);
}

void SharedTake::say() {
  const MonotonicInstant now = Monotonic::now();
  if (now < next_word_) return;
  next_word_ = now + kWordEvery;
  ShardMessage word = shard_.word();
  word.sent = Realtime::now();
  word.seq = word_seq_++;
  bus_.publish_sealed(shard_channel(me_), encode(word));
}

void SharedTake::add(ReadySet set) {
  const std::lock_guard lock(mutex_);
  shard_.add(std::move(set));
  act();
}

bool SharedTake::begin(int64_t pulse) {
  const std::lock_guard lock(mutex_);
  return shard_.begin(pulse);
}

void SharedTake::made(MeshMessage mesh) {
  ShardMeshMessage message;
  static_cast<MeshMessage&>(message) = std::move(mesh);
  message.node = me_;
  message.seq = mesh_seq_++;
  bus_.publish_sealed(shard_mesh_channel(me_), encode(message));
  const std::lock_guard lock(mutex_);
  shard_.made(std::move(static_cast<MeshMessage&>(message)));
  act();
}

void SharedTake::gave_up(int64_t pulse) {
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
  return words_.counts().undecodable + meshes_.counts().undecodable + shown_.counts().undecodable;
}

}  // namespace v3d
