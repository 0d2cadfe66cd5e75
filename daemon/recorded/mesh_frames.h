// The reconstructed frames of a take.
#pragma once

#include <filesystem>
#include <vector>

#include "daemon/recorded/frame_range.h"
#include "recon/pipeline/compact_frame.h"
#include "take/logs/mesh_file.h"
#include "take/take.h"

namespace v3d {

class MeshFrames {
 public:
  /// Throws InputError when the folder is no take or was not reconstructed yet.
  explicit MeshFrames(const std::filesystem::path& take);
  /// Another mesh file of the take, as copies of its mesh.v3d are.
  MeshFrames(const std::filesystem::path& take, const std::filesystem::path& file);

  /// Whether the file ends without its index: it was truncated, or its writer did not finish.
  bool is_unfinished() const { return file_.index_was_rebuilt(); }
  /// Frames in the range, rising. Throws InputError when there is none.
  std::vector<int64_t> frames(FrameRange range) const;
  /// Throws InputError when there is no such frame or it is damaged, or one that it needs. Fast in
  /// rising order: otherwise decoding begins at the key frame before.
  CompactFrame read(int64_t frame);

 private:
  void decode(int64_t frame);
  [[noreturn]] void refuse(int64_t frame) const;

  std::filesystem::path path_;
  MeshFileReader file_;
  CompactDecoder decoder_;
};

}  // namespace v3d
