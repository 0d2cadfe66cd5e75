#include "calibrate/floor_boards.h"

#include "base/core/error.h"
#include "calib/boards/board_pose.h"
#include "calib/rig/floor_fit.h"
#include "common/console.h"
#include "v3dctl/process.h"

namespace v3d::calibrate {
namespace {

using calib::BoardDetector;
using calib::CameraObservations;

constexpr int kImages = 5;  // of each camera; the board does not move

struct FloorCamera {
  const RigCamera* camera = nullptr;
  std::vector<Image> images;
};

FloorCamera read_images(NamedSource& named, const Rig& rig) {
  const int index = find_camera(rig, named.camera);
  if (index < 0) throw InputError(named.camera + ": the calibration has no such camera");
  FloorCamera camera{&rig[static_cast<size_t>(index)], {}};
  while (std::ssize(camera.images) < kImages) {
    auto image = named.source.next();
    if (!image) break;
    if (!(image->pixels.size == camera.camera->model.size())) {
      throw InputError(named.camera +
                       ": the size of its images differs from that of its calibration");
    }
    camera.images.push_back(std::move(image->pixels));
  }
  return camera;
}

/// The observations of all cameras, for an approximate pose of the board.
std::vector<CameraObservations> search_at(const std::vector<FloorCamera>& cameras,
                                          const RigidTransform& world_from_board,
                                          const BoardDetector& detector) {
  std::vector<CameraObservations> observed;
  for (const FloorCamera& camera : cameras) {
    const CameraModel& model = camera.camera->model;
    const CameraModel in_board_frame =
        calib::with_pose(model, model.cam_from_world() * world_from_board);
    CameraObservations observations{camera.camera->name, model.size(), {}};
    for (size_t i = 0; i < camera.images.size(); ++i) {
      auto observation = detector.find_at(camera.images[i].view(), in_board_frame);
      if (observation) observations.observations[static_cast<int64_t>(i)] = std::move(*observation);
    }
    if (!observations.observations.empty()) observed.push_back(std::move(observations));
    ctl::stop_if_interrupted();
  }
  return observed;
}

/// Searches in the first image of each camera, without a prediction.
std::vector<CameraObservations> search_everywhere(const std::vector<FloorCamera>& cameras,
                                                  const BoardDetector& detector) {
  std::vector<CameraObservations> observed;
  Progress progress("searching the board", std::ssize(cameras));
  for (const FloorCamera& camera : cameras) {
    progress.advance();
    if (camera.images.empty()) continue;
    auto observation = detector.find_small(camera.images.front().view());
    if (!observation) continue;
    observed.push_back({camera.camera->name, camera.camera->model.size(), {{0, *observation}}});
    ctl::stop_if_interrupted();
  }
  return observed;
}

/// Searches at the pose and size that two or more cameras give by triangulation. It does not depend
/// on the scale of the rig.
std::vector<CameraObservations> search_by_triangulation(
    const std::vector<FloorCamera>& cameras, const Rig& rig, const BoardDetector& detector,
    const std::vector<CameraObservations>& observed) {
  const auto found = locate_board(rig, detector.board(), observed);
  if (!found) return {};
  calib::Board scaled_board = detector.board();
  scaled_board.square_m /= found->scale;
  scaled_board.marker_m /= found->scale;
  RigidTransform world_from_board = found->rigid.inverse();
  world_from_board.translation /= found->scale;
  return search_at(cameras, world_from_board, BoardDetector(scaled_board));
}

/// Searches at the possible poses from one camera. It depends on the scale of the rig.
std::vector<CameraObservations> search_by_pose(const std::vector<FloorCamera>& cameras,
                                               const Rig& rig, const BoardDetector& detector,
                                               const CameraObservations& observed) {
  std::vector<CameraObservations> best;
  const CameraModel& model = rig[static_cast<size_t>(find_camera(rig, observed.name))].model;
  for (const auto& pose :
       board_poses(model, detector.board(), observed.observations.begin()->second)) {
    auto all = search_at(cameras, model.cam_from_world().inverse() * pose.cam_from_board, detector);
    if (all.size() > best.size()) best = std::move(all);
  }
  return best;
}

}  // namespace

std::vector<CameraObservations> find_floor_boards(const RigSources& sources, const Rig& rig,
                                                  const BoardDetector& detector) {
  std::vector<FloorCamera> cameras;
  for (NamedSource& named : open_sources(sources)) cameras.push_back(read_images(named, rig));
  std::vector<CameraObservations> observed = search_everywhere(cameras, detector);
  if (observed.empty()) return observed;
  auto refined = observed.size() > 1 ? search_by_triangulation(cameras, rig, detector, observed)
                                     : search_by_pose(cameras, rig, detector, observed.front());
  return refined.size() >= observed.size() ? refined : observed;
}

}  // namespace v3d::calibrate
