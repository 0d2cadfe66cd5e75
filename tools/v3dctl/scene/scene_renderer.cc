#include "v3dctl/scene/scene_renderer.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>

#include "base/core/error.h"
#include "base/image/image_files.h"
#include "daemon/recorded/mesh_frames.h"
#include "recon/render/renderer.h"
#include "v3dctl/export/mesh_export.h"
#include "v3dctl/mesh_options.h"

namespace v3d::ctl {
namespace {

void append(Mesh& all, const Mesh& part) {
  const auto first = static_cast<uint32_t>(all.vertices.size());
  all.vertices.insert(all.vertices.end(), part.vertices.begin(), part.vertices.end());
  all.colours.insert(all.colours.end(), part.colours.begin(), part.colours.end());
  all.colours.resize(all.vertices.size(), {180, 180, 180});
  for (const auto& [a, b, c] : part.triangles) {
    all.triangles.push_back({first + a, first + b, first + c});
  }
}

/// Camera of the scene in the frame of a take. Only its direction is set: colours depend on no
/// more.
CameraModel camera_in_take(const CameraModel& camera, const Placement& place) {
  const Eigen::Matrix3d cam_from_take = camera.cam_from_world().rotation * place.rotation();
  return {camera.size(), camera.matrix(), Distortion{}, {cam_from_take, Eigen::Vector3d::Zero()}};
}

Image render_sphere(const CameraModel& camera, const Image& sphere, double turn_deg) {
  Image seen(camera.size(), PixelFormat::kRGB8);
  const double width = sphere.size.width, height = sphere.size.height;
  for (int y = 0; y < seen.size.height; ++y) {
    for (int x = 0; x < seen.size.width; ++x) {
      const Eigen::Vector3d d = *camera.ray({x, y});
      const double azimuth = std::atan2(d.y(), d.x()) - turn_deg * std::numbers::pi / 180;
      const double u = 0.5 - azimuth / (2 * std::numbers::pi);
      const double v = std::acos(std::clamp(d.z(), -1.0, 1.0)) / std::numbers::pi;
      sample_picture(sphere, u * width - 0.5, v * height - 0.5, seen.row(y) + 3 * x);
    }
  }
  return seen;
}

}  // namespace

SceneRenderer::SceneRenderer(Scene scene, const Options& options)
    : scene_(std::move(scene)), options_(options) {
  for (const SceneTake& take : scene_.takes) {
    auto meshes = std::make_unique<recorded::MeshFrames>(take.take);
    auto pulses = meshes->frames({});
    const auto source = options.view_dependent
                            ? resolved_view_source(options.view_source, take.take)
                            : recorded::ViewSource::kPhotographs;
    meshes->enable_views(options.view_dependent && source == recorded::ViewSource::kMesh);
    const take::TakePaths paths{take.take};
    std::optional<recorded::TakeFrames> photographs;
    if (options.view_dependent && source == recorded::ViewSource::kPhotographs) {
      photographs.emplace(take.take, recorded::recorded_cameras(paths));
    }
    actors_.push_back({take, std::move(meshes), std::move(pulses), load_take_info(paths).rate_hz,
                       source, std::move(photographs)});
  }
  for (const SceneModel& model : scene_.models) {
    append(models_, lit_model(load_model(model.model), model.place.world_from_own()));
  }
  const SceneBackground& background = scene_.background;
  if (!background.image.empty()) still_ = fill_size(read_picture(background.image), options.size);
  if (!background.sphere.empty()) sphere_ = read_picture(background.sphere);
  if (!background.video.empty()) {
    if (!std::filesystem::exists(background.video)) {
      throw InputError(background.video.string() + ": does not exist");
    }
    video_ = std::make_unique<VideoReader>(background.video, options.size, scene_.rate_hz);
  }
}

std::vector<SoundClip> SceneRenderer::clips() const {
  std::vector<SoundClip> clips;
  for (const Actor& actor : actors_) {
    clips.push_back({.take = actor.take,
                     .rate_hz = actor.rate_hz,
                     .part = part_of(actor.take, actor.pulses.front(), actor.pulses.back())});
  }
  return clips;
}

int SceneRenderer::report_unfinished_takes() const {
  int status = kExitDone;
  std::set<std::filesystem::path> reported;  // a scene may show a take several times
  for (const Actor& actor : actors_) {
    if (!reported.insert(actor.meshes->path()).second) continue;
    status = std::max(status, report_unfinished_meshes(*actor.meshes));
  }
  return status;
}

Image SceneRenderer::backdrop(const CameraModel& camera, double seconds) {
  if (video_) {
    return video_->picture(static_cast<int64_t>(std::floor(seconds * scene_.rate_hz + 1e-6)));
  }
  if (sphere_.size.pixels() > 0) {
    return render_sphere(camera, sphere_, scene_.background.turn_deg);
  }
  return still_;
}

Mesh SceneRenderer::coloured(Actor& actor, const CameraModel& camera,
                             const recon::CompactFrame& frame) const {
  if (!options_.view_dependent) return frame.mesh;
  const CameraModel eye = camera_in_take(camera, actor.take.place);
  return actor.photographs
             ? recorded::ViewColours(*actor.photographs, frame).coloured_for(eye)
             : recorded::ViewColours(actor.take.take, frame, actor.view_source).coloured_for(eye);
}

void SceneRenderer::add_take(Actor& actor, const CameraModel& camera, double seconds,
                             Mesh& all) const {
  const auto pulse =
      pulse_at(actor.take, actor.rate_hz, actor.pulses.front(), actor.pulses.back(), seconds);
  if (!pulse) return;
  // A pulse without a mesh shows the previous mesh.
  const auto next = std::ranges::upper_bound(actor.pulses, *pulse);
  const recon::CompactFrame frame =
      actor.meshes->read(*(next == actor.pulses.begin() ? next : next - 1));
  Mesh mesh = coloured(actor, camera, frame);
  if (actor.take.performer) {
    mesh.triangles = recon::triangles_of_performer(mesh, frame.performers, *actor.take.performer);
  }
  const Eigen::Affine3f place = actor.take.place.world_from_own().cast<float>();
  for (Eigen::Vector3f& vertex : mesh.vertices) vertex = place * vertex;
  append(all, mesh);
}

Image SceneRenderer::draw_at(double seconds) {
  const CameraModel camera = camera_model(camera_at(scene_.camera, seconds), options_.size);
  Mesh all = models_;
  for (Actor& actor : actors_) add_take(actor, camera, seconds, all);
  const Image behind = backdrop(camera, seconds);
  recon::DrawOptions options{.top = scene_.background.colour, .bottom = scene_.background.colour};
  if (behind.size.pixels() > 0) options.backdrop = &behind;
  if (scene_.floor) options.floor = recon::FloorOptions{};
  return draw_mesh(all, camera, options);
}

}  // namespace v3d::ctl
