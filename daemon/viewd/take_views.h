// What every camera says about the vertices of a recorded take's meshes: what the paper's
// view-dependent rendering blends, for the page to do so.
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
#include "daemon/viewd/file_stamp.h"

namespace v3d {

/// Keeps the takes that were asked for last open. To go on in a take costs a mesh to decode and the
/// frames of a pulse to read, segment and look at; to jump costs what lies between as well: the
/// meshes since the key frame, and every 32nd frame since the take's beginning, from which the
/// background model follows the light. One thread; works on several cameras at a time.
class TakeViews {
 public:
  static constexpr size_t kMaxTakes = 4;  ///< open at a time: a scene's

  /// `takes`: the folder that holds them.
  explicit TakeViews(std::filesystem::path takes) : takes_(std::move(takes)) {}

  /// vertex_views_message() of the mesh of that pulse, in the order of its vertices. Empty where
  /// there is no such mesh. `take` must be is_file_name(). Throws InputError where the take has no
  /// raw frames, or is damaged.
  std::optional<std::string> read(const std::string& take, int64_t pulse);

  /// What it is made of, for HTTP: another content has another tag. Empty where the take has no
  /// meshes or no raw frames. Pure but for the disk; any thread.
  static std::optional<std::string> tag(const std::filesystem::path& take);

 private:
  struct OpenTake {
    std::string name;
    std::string tag;
    FileStamp mesh;
    std::unique_ptr<MeshFrames> meshes;
    TakeFrames frames;
    std::vector<int64_t> pulses;  ///< of its meshes, rising
  };
  OpenTake& open(const std::string& take, int64_t pulse);
  /// Whether nothing has changed but that more is recorded, behind the pulse.
  static bool has_grown(const OpenTake& take, const FileStamp& mesh, int64_t pulse);

  const std::filesystem::path takes_;
  std::list<OpenTake> open_;  ///< the front is what was used last
};

}  // namespace v3d
