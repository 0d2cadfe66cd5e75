// UnreadableByte: makes reads of one byte of recorded files fail in a test program.
#pragma once

#include <sys/types.h>

#include <filesystem>

namespace v3d::test {

/// During its lifetime, pread() of this byte of every log and mesh file fails with EIO. One object
/// at a time.
class UnreadableByte {
 public:
  /// `folder`: concerns files directly in this folder only; empty: all.
  explicit UnreadableByte(off_t at, const std::filesystem::path& folder = {});
  ~UnreadableByte();
  UnreadableByte(const UnreadableByte&) = delete;
  UnreadableByte& operator=(const UnreadableByte&) = delete;
};

}  // namespace v3d::test
