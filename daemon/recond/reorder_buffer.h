// Meshes of several makers, put in order.
#pragma once

#include <cstdint>
#include <map>
#include <optional>

#include "wire/messages.h"

namespace v3d {

/// Takes meshes in any order and gives them out in the order of their pulses, each pulse once. A
/// pulse that will have none must be passed over. Bounded: who looks at is_full() passes over what
/// the stream waits for. One thread.
class ReorderBuffer {
 public:
  struct Limits {
    size_t meshes = 512;
    size_t bytes = 128 << 20;
  };
  /// The stream begins with the pulse `first`.
  explicit ReorderBuffer(int64_t first) : ReorderBuffer(first, Limits{}) {}
  ReorderBuffer(int64_t first, Limits limits) : limits_(limits), next_(first) {}

  /// False for a pulse that it has, or that the stream is past.
  bool add(MeshMessage mesh);
  /// The mesh that the stream waits for, when it is there: the stream goes on behind it.
  std::optional<MeshMessage> take();
  /// The pulse that the stream waits for has no mesh: the stream goes on behind it. It must not be
  /// there.
  void pass_over() { ++next_; }

  /// The pulse that the stream waits for.
  int64_t next() const { return next_; }
  bool has(int64_t pulse) const { return pulse < next_ || waiting_.contains(pulse); }
  bool is_full() const { return waiting_.size() >= limits_.meshes || bytes_ >= limits_.bytes; }

 private:
  const Limits limits_;
  int64_t next_;
  std::map<int64_t, MeshMessage> waiting_;
  size_t bytes_ = 0;  ///< of those that wait
};

}  // namespace v3d
