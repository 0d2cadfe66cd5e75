// Pictures of a scene, without a browser.
#pragma once

#include <memory>
#include <vector>

#include "base/image.h"
#include "daemon/recorded/mesh_frames.h"
#include "v3dctl/scene/gltf_model.h"
#include "v3dctl/scene/scene_clock.h"
#include "v3dctl/scene/scene_file.h"
#include "v3dctl/scene/scene_video.h"

namespace v3d::ctl {

/// Everything that the scene names is opened at the beginning, so what is missing is told then.
/// One thread; draws on all processors.
class SceneRenderer {
 public:
  struct Options {
    ImageSize size{1280, 720};
    /// Colours of takes for the camera of the scene: their pictures are wanted again.
    bool view_dependent = false;
  };

  /// Throws InputError: a file that is missing or none of its kind.
  SceneRenderer(Scene scene, const Options& options);

  const Scene& scene() const { return scene_; }
  /// RGB8. Times must not fall where the background is a video; fast where they rise.
  Image draw(int64_t frame) { return draw_at(scene_.time_of(frame)); }
  Image draw_at(double seconds);

 private:
  struct Actor {
    SceneTake take;
    std::unique_ptr<MeshFrames> meshes;
    std::vector<int64_t> pulses;
    double rate_hz;
  };

  void add_take(Actor& actor, const CameraModel& eye, double seconds, Mesh& all) const;
  Image backdrop(const CameraModel& eye, double seconds);

  const Scene scene_;
  const Options options_;
  std::vector<Actor> actors_;
  Mesh models_;
  Image still_;   ///< fills the picture
  Image sphere_;  ///< all directions
  std::unique_ptr<VideoReader> video_;
};

}  // namespace v3d::ctl
