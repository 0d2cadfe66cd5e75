// Puts the meshes of several nodes into the order of their pulses.
#pragma once

#include <cstdint>
#include <map>
#include <optional>

#include "wire/messages.h"

namespace v3d {

/// A buffer that accepts meshes in any order and returns them by ascending pulse, each pulse once.
///
/// The caller must skip() each pulse that has no mesh, and must skip() when is_full(): add() itself
/// enforces no limit. One thread.
class ReorderBuffer {
 public:
  struct Limits {
    size_t meshes = 512;
    size_t bytes = 128 << 20;
  };
  /// The stream starts with the pulse `first`.
  explicit ReorderBuffer(int64_t first) : ReorderBuffer(first, Limits{}) {}
  ReorderBuffer(int64_t first, Limits limits) : limits_(limits), next_(first) {}

  /// Returns false for a pulse that is buffered already, or before next().
  bool add(MeshMessage mesh);
  /// Removes and returns the mesh of next() and advances to the following pulse. Empty when that
  /// mesh is not buffered.
  std::optional<MeshMessage> take();
  /// Advances past next(), which must not be buffered.
  void skip() { ++next_; }

  /// The pulse that take() returns next.
  int64_t next() const { return next_; }
  /// Is the mesh of `pulse` buffered, or is `pulse` before next()?
  bool has(int64_t pulse) const { return pulse < next_ || waiting_.contains(pulse); }
  bool is_full() const { return waiting_.size() >= limits_.meshes || bytes_ >= limits_.bytes; }

 private:
  const Limits limits_;
  int64_t next_;
  std::map<int64_t, MeshMessage> waiting_;
  size_t bytes_ = 0;  ///< of waiting_
};

}  // namespace v3d
