#include "calibrate/rig_boards.h"

#include "base/core/error.h"
#include "base/core/text.h"
#include "base/io/file.h"
#include "calib/boards/board.h"
#include "calib/formats/text_fields.h"
#include "calib/rig/rig_alignment.h"
#include "calibrate/calibration_images.h"
#include "cli/command.h"
#include "common/console.h"
#include "take/take.h"

namespace v3d::calibrate {
namespace {

constexpr std::string_view kOneSourceRule =
    "use exactly one of --video, --images, --take and --live";

void require_equal_lists(const RigSources& sources, const RigBoards& boards) {
  if (sources.images.empty()) return;
  for (size_t i = 1; i < boards.found.size(); ++i) {
    if (boards.found[i].images == boards.found[0].images) continue;
    throw InputError("--images: " + boards.cameras[0].name + " has " +
                     ctl::count_of(boards.found[0].images, "image") + " and " +
                     boards.cameras[i].name + " " + std::to_string(boards.found[i].images) +
                     ": the n-th images of all cameras must show the same instant");
  }
}

/// The observations by instant. Frames that are not in the table are ignored.
calib::CameraObservations by_time_stamp(const calib::CameraObservations& by_frame,
                                        const std::map<int64_t, int64_t>& instants) {
  calib::CameraObservations camera{by_frame.name, by_frame.size, {}};
  for (const auto& [frame, observation] : by_frame.observations) {
    const auto found = instants.find(frame);
    if (found != instants.end()) camera.observations[found->second] = observation;
  }
  return camera;
}

void note_stamps_beyond(const std::string& camera, const calib::FrameInstants& frames) {
  if (frames.beyond == 0) return;
  note("v3dctl: " + camera + ": its video lacks " + ctl::count_of(frames.beyond, "frame") +
       " at its end that --timestamps has");
}

/// The values of an option. The calibration file cannot hold every name.
std::vector<ctl::CameraFile> named_files(const std::vector<std::string>& values,
                                         const std::string& option) {
  std::vector<ctl::CameraFile> files = ctl::parse_camera_files(values, option);
  for (const auto& [camera, file] : files) {
    if (is_camera_name(camera)) continue;
    throw InputError(option + " " + camera + ": " + std::string(kCameraNameRule));
  }
  return files;
}

}  // namespace

void RigArguments::add_to(cli::Command command) {
  command.add_option("--video", videos, "The video of a camera; repeat for each camera")
      .type_name("CAM=FILE");
  command
      .add_option("--images", images,
                  "The images of a camera (quote the pattern); the n-th images of all cameras "
                  "show one instant")
      .type_name("CAM=GLOB");
  command.add_option("--take", given.take, "A take of the board; all its cameras are used")
      .type_name("TAKE");
  add_live_option(command, live_s);
  command
      .add_option("--every", given.sampling.every,
                  "Use every Nth frame (default: about 300 frames)")
      .type_name("N")
      .check(cli::positive_number());
}

void RigArguments::add_time_stamps_to(cli::Command command) {
  command
      .add_option("--timestamps", given.time_stamps,
                  "Assigns frames of the videos to instants: sync_index,cam_id,frame_index")
      .type_name("CSV");
}

void RigArguments::require_used_options() const {
  const int kinds = !videos.empty() + !images.empty() + !given.take.empty() + (live_s > 0);
  if (kinds > 1) throw InputError(std::string(kOneSourceRule));
  if (!given.time_stamps.empty() && videos.empty()) {
    throw InputError("--timestamps assigns frames of videos: expected --video CAM=FILE");
  }
  require_no_interval_of_images(given.sampling, !images.empty());
}

RigSources RigArguments::sources(const ctl::CommandLine& line) const {
  require_used_options();
  RigSources result = given;
  result.videos = named_files(videos, "--video");
  result.images = named_files(images, "--images");
  if (live_s > 0) result.take = record_live_take(line.studio(), live_s);
  return result;
}

void require_no_interval_of_images(const Sampling& sampling, bool has_images) {
  if (sampling.every > 0 && has_images) {
    throw InputError("--every chooses frames of videos and takes; --images uses all that match");
  }
}

void add_live_option(cli::Command command, double& seconds) {
  command
      .add_option("--live", seconds,
                  "Record a take of this length now, with the cameras of the studio")
      .type_name("SECONDS")
      .check(cli::number_in(0.2, 3600));
}

namespace {

std::vector<NamedSource> with_names(const std::vector<std::string>& cameras,
                                    std::vector<ImageSource> sources) {
  std::vector<NamedSource> named;
  for (size_t i = 0; i < cameras.size(); ++i) named.push_back({cameras[i], std::move(sources[i])});
  return named;
}

std::vector<NamedSource> open_rig_videos(const RigSources& sources) {
  std::vector<std::string> cameras;
  std::vector<std::filesystem::path> files;
  for (const auto& [camera, file] : sources.videos) {
    cameras.push_back(camera);
    files.push_back(file);
  }
  Sampling sampling = sources.sampling;
  // A table of time stamps refers to frame numbers, so no frame may be skipped.
  if (!sources.time_stamps.empty() && sampling.every == 0) sampling.every = 1;
  return with_names(cameras, open_videos(files, sampling));
}

}  // namespace

std::vector<NamedSource> open_sources(const RigSources& sources) {
  const int given = !sources.videos.empty() + !sources.images.empty() + !sources.take.empty();
  if (given != 1) throw InputError(std::string(kOneSourceRule));
  if (!sources.videos.empty()) return open_rig_videos(sources);
  if (!sources.take.empty()) {
    const std::vector<std::string> cameras = load_take_info(take::TakePaths{sources.take}).cameras;
    return with_names(cameras, open_take(sources.take, cameras, sources.sampling));
  }
  std::vector<NamedSource> opened;
  for (const auto& [camera, pattern] : sources.images) {
    opened.push_back({camera, open_images(pattern)});
  }
  return opened;
}

RigBoards find_rig_boards(const RigSources& sources, const calib::BoardDetector& detector) {
  calib::TimeStamps stamps;
  if (!sources.time_stamps.empty()) {
    stamps = calib::parse_time_stamps(read_file(sources.time_stamps), sources.time_stamps);
  }
  RigBoards boards;
  for (NamedSource& named : open_sources(sources)) {
    boards.found.push_back(find_boards(named.camera, std::move(named.source), detector));
    const FoundBoards& found = boards.found.back();
    calib::CameraObservations camera{named.camera, found.size, {}};
    for (size_t i = 0; i < found.views.size(); ++i) {
      camera.observations[found.numbers[i]] = found.views[i].observation;
    }
    if (!sources.time_stamps.empty()) {
      const calib::FrameInstants frames =
          calib::frame_instants(stamps, named.camera, found.frames, sources.time_stamps);
      note_stamps_beyond(named.camera, frames);
      camera = by_time_stamp(camera, frames.instants);
    }
    boards.cameras.push_back(std::move(camera));
  }
  require_equal_lists(sources, boards);
  return boards;
}

std::string time_offset_remedy(const RigSources& sources) {
  if (!sources.take.empty()) {
    return "check the trigger cables of these cameras; v3dctl verify " + sources.take.string() +
           " shows frames whose pulse numbers are suspect";
  }
  if (!sources.images.empty()) {
    return "the n-th images of all cameras must show the same instant";
  }
  return sources.time_stamps.empty()
             ? "use --timestamps, or cut the videos so that they start at the same moment"
             : "check the time stamps of " + sources.time_stamps.string();
}

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
  Progress progress("searching the board", std::ssize(cameras), "cameras");
  for (const FloorCamera& camera : cameras) {
    ctl::stop_if_interrupted();
    progress.advance();
    if (camera.images.empty()) continue;
    auto observation = detector.find_small(camera.images.front().view());
    if (!observation) continue;
    observed.push_back({camera.camera->name, camera.camera->model.size(), {{0, *observation}}});
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
