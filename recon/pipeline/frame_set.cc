#include "recon/pipeline/frame_set.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace v3d::recon {

RigFrames usable_frames(const Rig& rig, const FrameSet& set) {
  RigFrames frames(rig.size(), nullptr);
  for (const Frame& frame : set.frames) {
    const int c = find_camera(rig, frame.camera);
    if (c >= 0 && frame.mask && frame.mask->size() == rig[c].model.size() &&
        frame.image.size == ImageSize{frame.roi.width, frame.roi.height}) {
      frames[c] = &frame;
    }
  }
  return frames;
}

std::vector<std::string> names_of(const Rig& rig, const RigFrames& frames) {
  std::vector<std::string> names;
  for (size_t c = 0; c < frames.size(); ++c) {
    if (frames[c] != nullptr) names.push_back(rig[c].name);
  }
  std::sort(names.begin(), names.end());
  return names;
}

std::vector<std::string> late_cameras_of(const RigFrames& frames, int64_t pulse) {
  std::vector<std::string> names;
  for (const Frame* frame : frames) {
    if (frame != nullptr && frame->label.pulse == pulse + 1) names.push_back(frame->camera);
  }
  std::sort(names.begin(), names.end());
  return names;
}

FrameSetAssembler::FrameSetAssembler(FrameSetOptions options) : options_(std::move(options)) {
  auto& names = options_.cameras;
  std::sort(names.begin(), names.end());
  names.erase(std::unique(names.begin(), names.end()), names.end());
  cameras_ = names.size();
  last_sent_ = options_.released_until;
}

std::vector<ReadySet> FrameSetAssembler::add(Frame frame, MonotonicInstant now) {
  accept(std::move(frame), now);
  return poll(now);
}

void FrameSetAssembler::accept(Frame&& frame, MonotonicInstant now) {
  const int64_t pulse = frame.label.pulse;
  if (!std::binary_search(options_.cameras.begin(), options_.cameras.end(), frame.camera)) {
    ++counters_.unknown;
    return;
  }
  if (!plausible_.contains(pulse, now)) {
    ++counters_.implausible;
    return;
  }
  if (last_sent_ && pulse <= *last_sent_) {
    ++counters_.late;
    return;
  }
  OpenSet& set = open_.try_emplace(pulse, OpenSet{now + options_.deadline, {}}).first->second;
  if (!set.frames.try_emplace(frame.camera, std::move(frame)).second) {
    ++counters_.duplicate;
  }
  plausible_.add(pulse, now);
}

std::vector<ReadySet> FrameSetAssembler::poll(MonotonicInstant now) {
  std::vector<ReadySet> ready;
  while (!open_.empty()) {
    const OpenSet& oldest = open_.begin()->second;
    const bool crowded = open_.size() > static_cast<size_t>(options_.max_open);
    if (!is_complete(oldest) && now < oldest.due && !crowded) {
      break;
    }
    send_oldest(ready);
  }
  return ready;
}

std::vector<ReadySet> FrameSetAssembler::flush() {
  std::vector<ReadySet> ready;
  while (!open_.empty()) {
    send_oldest(ready);
  }
  return ready;
}

std::optional<MonotonicInstant> FrameSetAssembler::next_deadline() const {
  if (open_.empty()) {
    return std::nullopt;
  }
  return open_.begin()->second.due;
}

void FrameSetAssembler::restart() {
  open_.clear();
  last_sent_.reset();
  plausible_ = PlausiblePulses();
}

void FrameSetAssembler::send_oldest(std::vector<ReadySet>& ready) {
  auto node = open_.extract(open_.begin());
  OpenSet& open = node.mapped();
  ++(is_complete(open) ? counters_.complete : counters_.incomplete);
  ReadySet& sent = ready.emplace_back();
  sent.set.pulse = node.key();
  for (const std::string& camera : options_.cameras) {
    const auto found = open.frames.find(camera);
    if (found == open.frames.end()) {
      sent.missing.push_back(camera);
    } else {
      sent.set.frames.push_back(std::move(found->second));
    }
  }
  last_sent_ = node.key();
}

namespace {

/// A ball of this radius, metres, has 1.5 times the surface of a person.
constexpr double kRadius = 0.5;

/// The disc of the ball in the image; empty where the centre does not project to a pixel.
Mask silhouette(const CameraModel& model, const Eigen::Vector3d& centre, double radius) {
  Mask mask(model.size());
  const auto pixel = model.project(centre);
  if (!pixel) return mask;
  const double pixels = model.matrix()(0, 0) * radius / (centre - model.center()).norm();
  const int last = model.size().height - 1;
  const int top = std::clamp(static_cast<int>(pixel->y() - pixels), 0, last);
  const int bottom = std::clamp(static_cast<int>(pixel->y() + pixels), 0, last);
  for (int y = top; y <= bottom; ++y) {
    const double half = std::sqrt(std::max(0.0, pixels * pixels - std::pow(y - pixel->y(), 2)));
    const int begin = std::clamp(static_cast<int>(pixel->x() - half), 0, model.size().width);
    const int end = std::clamp(static_cast<int>(pixel->x() + half), begin, model.size().width);
    mask.fill_row(y, begin, end);
  }
  return mask;
}

}  // namespace

FrameSet warm_up_frame_set(const Rig& rig, const Box& bounds) {
  const double radius = std::min(kRadius, 0.25 * bounds.size().minCoeff());
  FrameSet set;
  for (const RigCamera& camera : rig) {
    Image raw(camera.model.size(), PixelFormat::kBayerRG8);
    std::fill(raw.bytes.begin(), raw.bytes.end(), uint8_t{128});
    set.frames.push_back(
        observe(camera.name, {}, raw.view(), silhouette(camera.model, bounds.center(), radius)));
  }
  return set;
}

}  // namespace v3d::recon
