// Vertex colours by camera for meshes of recorded takes: the input of view-dependent rendering
// (Algorithm 2 of the paper) in the browser.
#pragma once

#include <cstdint>
#include <filesystem>
#include <list>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "daemon/recorded/mesh_frames.h"
#include "daemon/recorded/take_frames.h"
#include "daemon/viewd/served_files.h"

namespace v3d {

/// Keeps the most recently used takes open. In ascending order of pulses, a read decodes one mesh
/// and reads and segments the frames of one pulse. A jump also decodes the meshes since the key
/// frame, and every 32nd frame since the start of the take, from which the background model adapts
/// to the light. One caller at a time; works on several cameras in parallel.
class TakeViews {
 public:
  static constexpr size_t kMaxTakes = 4;  ///< open takes: those of a scene

  /// `takes`: the folder of the takes.
  explicit TakeViews(std::filesystem::path takes) : takes_(std::move(takes)) {}

  /// vertex_views_message() of the mesh of that pulse, in the order of its vertices. Empty if there
  /// is no such mesh. Requires is_file_name(take). Throws InputError if the take has no raw frames,
  /// or is damaged.
  std::optional<std::string> read(const std::string& take, int64_t pulse);

  /// The ETag of all files that read() uses. Empty if the take has no meshes or no raw frames. Any
  /// thread.
  static std::optional<std::string> tag(const std::filesystem::path& take);

 private:
  struct OpenTake {
    std::string name;
    std::string tag;
    FileStamp mesh;
    std::unique_ptr<MeshFrames> meshes;
    TakeFrames frames;
    std::vector<int64_t> pulses;  ///< that have a mesh, ascending
  };
  OpenTake& open(const std::string& take, int64_t pulse);
  /// Has the take only grown since it was opened, after `pulse`?
  static bool has_grown(const OpenTake& take, const FileStamp& mesh, int64_t pulse);

  const std::filesystem::path takes_;
  std::list<OpenTake> open_;  ///< most recently used first
};

}  // namespace v3d
