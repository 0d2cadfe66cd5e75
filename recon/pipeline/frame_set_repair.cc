#include "recon/pipeline/frame_set_repair.h"

#include <algorithm>
#include <utility>

#include "base/image/mask_operations.h"
#include "recon/hull/voxel_grid.h"

namespace v3d::recon {
namespace {

std::vector<Frame>::iterator frame_of(const std::string& camera, FrameSet& set) {
  return std::ranges::find(set.frames, camera, &Frame::camera);
}

}  // namespace

FrameSetRepair::FrameSetRepair(const Rig& rig, const ReconstructOptions& options)
    : rig_(rig),
      repair_(rig, options.bounds, voxel_for_repair(options.bounds, options.voxel_m),
              options.min_views) {
  for (const RigCamera& camera : rig_) views_.push_back(bounds_mask(options.bounds, camera.model));
}

std::optional<RepairedFrameSet> FrameSetRepair::repair(FrameSet& set,
                                                       const StopRequest& should_stop) {
  const RigFrames frames = usable_frames(rig_, set);
  std::vector<Mask> visible(frames.size());
  std::vector<const Mask*> masks(frames.size(), nullptr);
  for (size_t c = 0; c < frames.size(); ++c) {
    if (frames[c] == nullptr) continue;
    visible[c] = intersection_of(*frames[c]->mask, views_[c]);
    masks[c] = &visible[c];
  }
  auto repaired = repair_.repair_unless(should_stop, masks, frames);
  if (!repaired) return std::nullopt;
  RepairedFrameSet result{.faults = std::move(repaired->faults), .replaced = {}};
  for (const SilhouetteFault& fault : result.faults) {
    const std::string& camera = rig_[fault.camera].name;
    if (!result.replaced.empty() && result.replaced.back().camera == camera) continue;
    const auto frame = frame_of(camera, set);
    std::optional<Mask>& mask = repaired->masks[fault.camera];
    result.replaced.push_back({camera, *std::exchange(frame->mask, mask)});
    if (!mask) set.frames.erase(frame);
  }
  return result;
}

void restore_masks(std::vector<ReplacedMask> replaced, FrameSet& set) {
  for (ReplacedMask& entry : replaced) {
    auto frame = frame_of(entry.camera, set);
    if (frame == set.frames.end()) {
      frame = set.frames.insert(frame, Frame());
      frame->camera = std::move(entry.camera);
      frame->sensor_size = entry.given.size();
    }
    frame->mask = std::move(entry.given);
  }
}

}  // namespace v3d::recon
