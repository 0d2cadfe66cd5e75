// Training sets: the views of a pulse, and the files of COLMAP and Nerfstudio.
#include "v3dctl/export/training_pulse.h"

#include <fmt/core.h>
#include <tbb/parallel_for.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/core/error.h"
#include "base/image/colour.h"
#include "base/image/image_files.h"
#include "base/io/file.h"
#include "common/mesh_formats.h"
#include "daemon/recorded/mesh_frames.h"
#include "recon/texture/texture.h"
#include "v3dctl/export/mesh_export.h"

namespace v3d::ctl {
namespace {

using SeenVertices = std::vector<std::array<uint8_t, 4>>;  // as CameraColours::vertices

TrainingView view_of(const RigCamera& camera, const recorded::SegmentedFrame& frame) {
  TrainingView view;
  view.camera = camera.name;
  view.model = recon::pinhole_of(camera.model, camera.name);
  Image image = to_rgb(frame.raw.image.view());
  if (!camera.colour.is_identity()) correct(image, camera.colour);
  view.picture = recon::undistorted({std::move(image), frame.mask}, camera.model, view.model);
  return view;
}

/// The vertices that the camera sees.
std::vector<PointInImage> points_in(const TrainingView& view, const CameraModel& camera,
                                    const std::vector<Eigen::Vector3f>& vertices,
                                    const SeenVertices& seen) {
  std::vector<PointInImage> points;
  for (size_t v = 0; v < seen.size(); ++v) {
    if (seen[v][3] == static_cast<uint8_t>(recon::Visibility::kNone)) continue;
    const auto pixel = recon::undistorted_pixel(vertices[v].cast<double>(), camera, view.model);
    if (pixel) points.push_back({v, *pixel});
  }
  return points;
}

/// Keeps the vertices that are in a view. Points of the views refer to the shorter list.
void keep_seen_points(const Mesh& mesh, TrainingPulse& pulse) {
  constexpr size_t kUnseen = SIZE_MAX;
  std::vector<size_t> number(mesh.vertices.size(), kUnseen);
  for (const TrainingView& view : pulse.views) {
    for (const PointInImage& point : view.points) number[point.point] = 0;
  }
  for (size_t v = 0; v < number.size(); ++v) {
    if (number[v] == kUnseen) continue;
    number[v] = pulse.points.vertices.size();
    pulse.points.vertices.push_back(mesh.vertices[v]);
    if (!mesh.colours.empty()) pulse.points.colours.push_back(mesh.colours[v]);
  }
  for (TrainingView& view : pulse.views) {
    for (PointInImage& point : view.points) point.point = number[point.point];
  }
}

}  // namespace

TrainingPulses::TrainingPulses(const std::filesystem::path& take, const std::string& option)
    : option_(option), frames_(require_raw_frames(take, option), {}) {}

TrainingPulse TrainingPulses::of(const recon::CompactFrame& frame) {
  const auto frames = recorded::read_used(recorded::used_cameras(frame), frames_);
  const recon::FrameSet set = observe_all(frame.pulse, frames);
  if (set.frames.empty()) {
    throw InputError(option_ + ": " + frames_.paths().folder.string() +
                     " has no raw frames of pulse " + std::to_string(frame.pulse));
  }
  if (set.frames.size() < frame.cameras.size()) ++incomplete_;
  const Rig& rig = frames_.rig();
  const std::vector<recon::CameraColours> seen = camera_colours(
      frame.mesh, recorded::texture_cameras(rig, set), recorded::texture_options(frame.mesh));
  std::vector<TrainingView> views(rig.size());
  tbb::parallel_for(size_t{0}, rig.size(), [&](size_t c) {
    if (!frames[c]) return;
    views[c] = view_of(rig[c], *frames[c]);
    for (const recon::CameraColours& colours : seen) {
      if (colours.camera != rig[c].name) continue;
      views[c].points = points_in(views[c], rig[c].model, frame.mesh.vertices, colours.vertices);
    }
  });
  std::erase_if(views, [](const TrainingView& view) { return view.camera.empty(); });
  TrainingPulse pulse{{}, std::move(views)};
  keep_seen_points(frame.mesh, pulse);
  return pulse;
}

namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr double kHalfPixel = 0.5;  // pixel coordinates of both programs minus ours

void make_folder(const fs::path& folder) { io::throw_if_failed(io::create_folders(folder)); }

/// images/CAMERA.png, and masks/CAMERA.png with `mask_ending` behind.
void write_images(const fs::path& folder, const TrainingPulse& pulse,
                  const std::string& mask_ending) {
  make_folder(folder / "images");
  make_folder(folder / "masks");
  tbb::parallel_for(size_t{0}, pulse.views.size(), [&](size_t n) {
    const TrainingView& view = pulse.views[n];
    const std::string name = view.camera + ".png";
    write_png(folder / "images" / name, view.picture.image.view(), PngEffort::kFast);
    write_png(folder / "masks" / (name + mask_ending), image_from_mask(view.picture.mask).view());
  });
}

/// fx, fy, cx, cy
std::array<double, 4> lens_of(const CameraModel& model) {
  const Eigen::Matrix3d& k = model.matrix();
  return {k(0, 0), k(1, 1), k(0, 2) + kHalfPixel, k(1, 2) + kHalfPixel};
}

std::string cameras_text(const TrainingPulse& pulse) {
  std::string text = "# CAMERA_ID MODEL WIDTH HEIGHT PARAMS[]\n";
  int id = 0;
  for (const TrainingView& view : pulse.views) {
    const auto [fx, fy, cx, cy] = lens_of(view.model);
    text += fmt::format("{} PINHOLE {} {} {:.17g} {:.17g} {:.17g} {:.17g}\n", ++id,
                        view.model.size().width, view.model.size().height, fx, fy, cx, cy);
  }
  return text;
}

std::string images_text(const TrainingPulse& pulse) {
  std::string text =
      "# IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME\n# POINTS2D[] as X Y POINT3D_ID\n";
  int id = 0;
  for (const TrainingView& view : pulse.views) {
    const RigidTransform& pose = view.model.cam_from_world();
    const Eigen::Quaterniond q(pose.rotation);
    const Eigen::Vector3d& t = pose.translation;
    text += fmt::format(
        "{0} {1:.17g} {2:.17g} {3:.17g} {4:.17g} {5:.17g} {6:.17g} {7:.17g} {0} {8}"
        ".png\n",
        ++id, q.w(), q.x(), q.y(), q.z(), t.x(), t.y(), t.z(), view.camera);
    for (const PointInImage& point : view.points) {
      text += fmt::format("{:.5f} {:.5f} {} ", point.pixel.x() + kHalfPixel,
                          point.pixel.y() + kHalfPixel, point.point + 1);
    }
    text += '\n';
  }
  return text;
}

/// The places of a point in images, and the sum of its reprojection errors, pixels.
struct Track {
  std::string places;
  double error = 0;
  int length = 0;
};

std::vector<Track> tracks_of(const TrainingPulse& pulse) {
  std::vector<Track> tracks(pulse.points.vertices.size());
  for (size_t image = 0; image < pulse.views.size(); ++image) {
    const TrainingView& view = pulse.views[image];
    for (size_t n = 0; n < view.points.size(); ++n) {
      const PointInImage& point = view.points[n];
      Track& track = tracks[point.point];
      track.places += fmt::format(" {} {}", image + 1, n);
      const Eigen::Vector3d world = pulse.points.vertices[point.point].cast<double>();
      if (const auto projected = view.model.project(world)) {
        track.error += (*projected - point.pixel).norm();
      }
      ++track.length;
    }
  }
  return tracks;
}

std::string points_text(const TrainingPulse& pulse) {
  std::string text = "# POINT3D_ID X Y Z R G B ERROR TRACK[] as IMAGE_ID POINT2D_IDX\n";
  const std::vector<Track> tracks = tracks_of(pulse);
  for (size_t i = 0; i < tracks.size(); ++i) {
    const Eigen::Vector3f& p = pulse.points.vertices[i];
    const Rgb8 c = pulse.points.colours.empty() ? Rgb8{128, 128, 128} : pulse.points.colours[i];
    text += fmt::format("{} {:.9g} {:.9g} {:.9g} {} {} {} {:.6g}{}\n", i + 1, p.x(), p.y(), p.z(),
                        c.r, c.g, c.b, tracks[i].error / tracks[i].length, tracks[i].places);
  }
  return text;
}

/// world_from_camera with OpenGL's axes, row by row.
Json opengl_pose(const RigidTransform& cam_from_world) {
  const RigidTransform world_from_cam = cam_from_world.inverse();
  Eigen::Matrix4d pose = Eigen::Matrix4d::Identity();
  pose.topLeftCorner<3, 3>() = world_from_cam.rotation;
  pose.topRightCorner<3, 1>() = world_from_cam.translation;
  pose.middleCols<2>(1) *= -1;
  Json rows = Json::array();
  for (int row = 0; row < 4; ++row) {
    rows.push_back({pose(row, 0), pose(row, 1), pose(row, 2), pose(row, 3)});
  }
  return rows;
}

Json transforms_of(const TrainingPulse& pulse) {
  Json frames = Json::array();
  for (const TrainingView& view : pulse.views) {
    const auto [fx, fy, cx, cy] = lens_of(view.model);
    Json frame{{"file_path", "images/" + view.camera + ".png"},
               {"mask_path", "masks/" + view.camera + ".png"},
               {"w", view.model.size().width},
               {"h", view.model.size().height},
               {"fl_x", fx},
               {"fl_y", fy},
               {"cx", cx},
               {"cy", cy}};
    for (const char* coefficient : {"k1", "k2", "p1", "p2"}) frame[coefficient] = 0;
    frame["transform_matrix"] = opengl_pose(view.model.cam_from_world());
    frames.push_back(std::move(frame));
  }
  return {{"camera_model", "OPENCV"}, {"ply_file_path", "points.ply"}, {"frames", frames}};
}

}  // namespace

void write_colmap(const fs::path& folder, const TrainingPulse& pulse) {
  write_images(folder, pulse, ".png");
  const fs::path model = folder / "sparse" / "0";
  make_folder(model);
  replace_file(model / "cameras.txt", cameras_text(pulse));
  replace_file(model / "images.txt", images_text(pulse));
  replace_file(model / "points3D.txt", points_text(pulse));
}

void write_nerfstudio(const fs::path& folder, const TrainingPulse& pulse) {
  write_images(folder, pulse, "");
  write_ply(folder / "points.ply", pulse.points);
  replace_file(folder / "transforms.json", transforms_of(pulse).dump(1) + "\n");
}

}  // namespace v3d::ctl
