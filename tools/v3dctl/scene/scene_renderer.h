// Renderer of scenes on the CPU.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/image/image.h"
#include "daemon/recorded/mesh_frames.h"
#include "v3dctl/scene/model.h"
#include "v3dctl/scene/scene_file.h"
#include "v3dctl/scene/scene_sound.h"
#include "v3dctl/scene/scene_video.h"

namespace v3d::ctl {

/// One calling thread; renders on all processors.
class SceneRenderer {
 public:
  struct Options {
    ImageSize size{1280, 720};
    /// View-dependent colours of takes for the camera of the scene.
    bool view_dependent = false;
    std::string view_source = "automatic";  ///< as for resolved_view_source()
  };

  /// Opens all files of the scene. Throws InputError for a file that is missing or of a wrong
  /// format.
  SceneRenderer(Scene scene, const Options& options);

  const Scene& scene() const { return scene_; }
  /// The takes of the scene, to mix their sound.
  std::vector<SoundClip> clips() const;
  /// Reports on stderr each mesh file of the scene without an index. Returns kExitDone or
  /// kExitIncomplete.
  int report_unfinished_takes() const;
  /// Renders one picture, RGB8. With a background video, requires times that do not decrease. Fast
  /// for increasing times.
  Image draw(int64_t frame) { return draw_at(scene_.time_of(frame)); }
  Image draw_at(double seconds);

 private:
  struct Actor {
    SceneTake take;
    std::unique_ptr<recorded::MeshFrames> meshes;
    std::vector<int64_t> pulses;
    double rate_hz;
    recorded::ViewSource view_source;  ///< without meaning where colours are not view-dependent
    std::optional<recorded::TakeFrames> photographs;  ///< open where colours come from them
  };

  Mesh coloured(Actor& actor, const CameraModel& camera, const recon::CompactFrame& frame) const;
  void add_take(Actor& actor, const CameraModel& camera, double seconds, Mesh& all) const;
  Image backdrop(const CameraModel& camera, double seconds);

  const Scene scene_;
  const Options options_;
  std::vector<Actor> actors_;
  Mesh models_;
  Image still_;   ///< background that fills the picture
  Image sphere_;  ///< background panorama
  std::unique_ptr<VideoReader> video_;
};

}  // namespace v3d::ctl
