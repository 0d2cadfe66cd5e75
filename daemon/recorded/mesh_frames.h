// Reader of the reconstructed frames of a take.
#pragma once

#include <filesystem>
#include <vector>

#include "daemon/recorded/frame_range.h"
#include "recon/pipeline/compact_frame.h"
#include "take/logs/mesh_file.h"
#include "take/take.h"

namespace v3d {

/// One thread.
class MeshFrames {
 public:
  /// Throws InputError if the folder is not a take, or if the take was not reconstructed.
  explicit MeshFrames(const std::filesystem::path& take);
  /// Reads `file`, a copy of the take's mesh.v3d, instead.
  MeshFrames(const std::filesystem::path& take, const std::filesystem::path& file);

  /// Has the file no index, because it was truncated or its writer did not finish?
  bool is_unfinished() const { return file_.index_was_rebuilt(); }
  /// Numbers of the frames in the range, ascending. Throws InputError if there are none.
  std::vector<int64_t> frames(FrameRange range) const;
  /// Decodes a frame. Fast in ascending order; otherwise decoding starts at the previous key frame.
  /// Throws InputError if the frame, or one that it refers to, is missing, damaged, or cannot be
  /// read from the disk (with path and cause).
  CompactFrame read(int64_t frame);

 private:
  void decode(int64_t frame);
  [[noreturn]] void throw_damaged(int64_t frame) const;

  std::filesystem::path path_;
  MeshFileReader file_;
  CompactDecoder decoder_;
};

}  // namespace v3d
