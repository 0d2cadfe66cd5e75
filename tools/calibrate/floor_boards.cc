#include "calibrate/floor_boards.h"

#include "base/error.h"
#include "calib/board_pose.h"
#include "calib/floor.h"
#include "common/console.h"
#include "v3dctl/process.h"

namespace v3d::calibrate {
namespace {

using calib::BoardDetector;
using calib::CameraSightings;

constexpr int kPictures = 5;  // of each camera; the board lies still

struct FloorCamera {
  const RigCamera* camera = nullptr;
  std::vector<Image> pictures;
};

FloorCamera read_pictures(NamedSource& named, const Rig& rig) {
  const int index = find_camera(rig, named.camera);
  if (index < 0) throw InputError(named.camera + ": the calibration has no such camera");
  FloorCamera camera{&rig[static_cast<size_t>(index)], {}};
  while (std::ssize(camera.pictures) < kPictures) {
    auto picture = named.source.next();
    if (!picture) break;
    if (!(picture->image.size == camera.camera->model.size())) {
      throw InputError(named.camera + ": the pictures have another size than its calibration");
    }
    camera.pictures.push_back(std::move(picture->image));
  }
  return camera;
}

/// All cameras' sightings, where the board of the detector is about at `world_from_board`.
std::vector<CameraSightings> look_there(const std::vector<FloorCamera>& cameras,
                                        const RigidTransform& world_from_board,
                                        const BoardDetector& detector) {
  std::vector<CameraSightings> seen;
  for (const FloorCamera& camera : cameras) {
    const CameraModel& model = camera.camera->model;
    const CameraModel in_board_frame =
        calib::placed(model, model.cam_from_world() * world_from_board);
    CameraSightings sightings{camera.camera->name, model.size(), {}};
    for (size_t i = 0; i < camera.pictures.size(); ++i) {
      auto sighting = detector.find_near(camera.pictures[i].view(), in_board_frame);
      if (sighting) sightings.sightings[static_cast<int64_t>(i)] = std::move(*sighting);
    }
    if (!sightings.sightings.empty()) seen.push_back(std::move(sightings));
    ctl::stop_if_interrupted();
  }
  return seen;
}

/// In the first picture of each camera, without knowing where.
std::vector<CameraSightings> look_around(const std::vector<FloorCamera>& cameras,
                                         const BoardDetector& detector) {
  std::vector<CameraSightings> seen;
  Progress progress("looking for the board", std::ssize(cameras));
  for (const FloorCamera& camera : cameras) {
    progress.advance();
    if (camera.pictures.empty()) continue;
    auto sighting = detector.find_small(camera.pictures.front().view());
    if (!sighting) continue;
    seen.push_back({camera.camera->name, camera.camera->model.size(), {{0, *sighting}}});
    ctl::stop_if_interrupted();
  }
  return seen;
}

/// Two cameras that see it tell where it is and how large, whatever the scale of the rig.
std::vector<CameraSightings> look_by_rays(const std::vector<FloorCamera>& cameras, const Rig& rig,
                                          const BoardDetector& detector,
                                          const std::vector<CameraSightings>& seen) {
  const auto found = place_board(rig, detector.board(), seen);
  if (!found) return {};
  calib::Board as_large = detector.board();
  as_large.square_m /= found->scale;
  as_large.marker_m /= found->scale;
  RigidTransform world_from_board = found->rigid.inverse();
  world_from_board.translation /= found->scale;
  return look_there(cameras, world_from_board, BoardDetector(as_large));
}

/// One camera alone trusts the scale of the rig.
std::vector<CameraSightings> look_by_pose(const std::vector<FloorCamera>& cameras, const Rig& rig,
                                          const BoardDetector& detector,
                                          const CameraSightings& seen) {
  std::vector<CameraSightings> best;
  const CameraModel& model = rig[static_cast<size_t>(find_camera(rig, seen.name))].model;
  for (const auto& pose : board_poses(model, detector.board(), seen.sightings.begin()->second)) {
    auto all =
        look_there(cameras, model.cam_from_world().inverse() * pose.cam_from_board, detector);
    if (all.size() > best.size()) best = std::move(all);
  }
  return best;
}

}  // namespace

std::vector<CameraSightings> find_floor_boards(const RigSources& sources, const Rig& rig,
                                               const BoardDetector& detector) {
  std::vector<FloorCamera> cameras;
  for (NamedSource& named : open_sources(sources)) cameras.push_back(read_pictures(named, rig));
  std::vector<CameraSightings> seen = look_around(cameras, detector);
  if (seen.empty()) return seen;
  auto more = seen.size() > 1 ? look_by_rays(cameras, rig, detector, seen)
                              : look_by_pose(cameras, rig, detector, seen.front());
  return more.size() >= seen.size() ? more : seen;
}

}  // namespace v3d::calibrate
