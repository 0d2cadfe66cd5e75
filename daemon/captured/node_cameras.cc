#include "daemon/captured/node_cameras.h"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <filesystem>

#include "base/config/calib_file.h"
#include "base/core/error.h"
#include "base/io/whole_file.h"
#include "capture/cameras/make_camera.h"
#include "daemon/node/take_folder.h"

namespace v3d {
namespace {

bool contains(const std::vector<std::string>& names, const std::string& name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

}  // namespace

NodeCameras::NodeCameras(const Studio& studio, const std::string& node, const PulseTimes& pulses)
    : studio_(studio) {
  for (const StudioCamera& camera : studio.cameras_of(node)) {
    workers_.push_back(std::make_unique<CameraWorker>(
        camera.name, [&pulses, camera] { return make_camera(camera, pulses); },
        CameraWorkerOptions{.queue_frames = kQueueFrames}));
  }
}

NodeCameras::~NodeCameras() {
  for (const auto& worker : workers_) worker->end();
}

void NodeCameras::arm(Duration period, bool edges_are_reported) {
  for (const auto& worker : workers_) worker->arm(period, edges_are_reported);
}

void NodeCameras::pulse_at(const PulseEdge& edge) {
  for (const auto& worker : workers_) worker->pulse_at(edge);
}

void NodeCameras::train_ended() {
  for (const auto& worker : workers_) worker->train_ended();
}

void NodeCameras::disarm() {
  for (const auto& worker : workers_) worker->disarm();
}

std::vector<CameraWorker*> NodeCameras::ready() const {
  std::vector<CameraWorker*> ready;
  for (const auto& worker : workers_) {
    if (worker->status().state == CameraState::kReady) ready.push_back(worker.get());
  }
  return ready;
}

std::string NodeCameras::not_ready(const std::vector<std::string>& may_be_missing) const {
  std::vector<std::string> cameras;
  for (const auto& worker : workers_) {
    const CameraWorkerStatus status = worker->status();
    if (status.state == CameraState::kReady || contains(may_be_missing, worker->camera())) continue;
    cameras.push_back(worker->camera() + " (" +
                      (status.text.empty() ? std::string(name(status.state)) : status.text) + ")");
  }
  return fmt::format("{}", fmt::join(cameras, ", "));
}

void NodeCameras::check_prepared(const std::vector<std::string>& may_be_missing) const {
  if (!file_exists(studio_.storage.calib)) {
    throw InputError(studio_.storage.calib.string() +
                     ": does not exist; v3dctl calibrate guess makes a first one");
  }
  const Rig rig = load_calib(studio_.storage.calib);
  for (const auto& worker : workers_) {
    const std::string& camera = worker->camera();
    if (find_camera(rig, camera) < 0) {
      throw InputError(studio_.storage.calib.string() + ": has no camera '" + camera + "' of " +
                       studio_.path.string() + "; calibrate the camera");
    }
    if (!has_background(studio_.storage.background, camera) && !contains(may_be_missing, camera)) {
      throw InputError(camera + " has no background model in " +
                       studio_.storage.background.string() +
                       "; clear the studio and run v3dctl background");
    }
  }
}

BackgroundModel NodeCameras::background_of(const CameraWorker& worker) const {
  BackgroundModel model = load_background(studio_.storage.background, worker.camera());
  const CameraWorkerStatus status = worker.status();
  if (status.size != model.size || status.format != model.format) {
    throw InputError(worker.camera() +
                     ": its background model has another image size or pixel format; "
                     "run v3dctl background");
  }
  return model;
}

double NodeCameras::bytes_per_pulse() const {
  double bytes = 0;
  for (const auto& worker : workers_) {
    const CameraWorkerStatus status = worker->status();
    bytes += static_cast<double>(byte_count(status.size, status.format));
  }
  return bytes;
}

int64_t NodeCameras::max_queued() const {
  int64_t longest = 0;
  for (const auto& worker : workers_) longest = std::max(longest, worker->waiting());
  return longest;
}

int64_t NodeCameras::dropped() const {
  int64_t sum = 0;
  for (const auto& worker : workers_) sum += worker->status().dropped;
  return sum;
}

std::string NodeCameras::fault_text() const {
  std::vector<std::string> lines;
  for (const auto& worker : workers_) {
    const std::string text = worker->status().text;
    if (!text.empty()) lines.push_back(worker->camera() + ": " + text);
  }
  return fmt::format("{}", fmt::join(lines, "; "));
}

}  // namespace v3d
