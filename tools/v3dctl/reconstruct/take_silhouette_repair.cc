#include "v3dctl/reconstruct/take_silhouette_repair.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <map>

#include "base/geometry/rigid_transform.h"
#include "base/image/mask_operations.h"
#include "recon/hull/voxel_grid.h"
#include "v3dctl/options.h"

namespace v3d::ctl {
TakeSilhouetteRepair::TakeSilhouetteRepair(const Rig& rig, const recon::ReconstructOptions& options)
    : rig_(rig),
      repair_(rig, options.bounds, recon::voxel_for_repair(options.bounds, options.voxel_m),
              options.min_views),
      views_(rig.size()) {
  tbb::parallel_for(size_t{0}, rig.size(), [&](size_t i) {
    views_[i] = recon::bounds_mask(options.bounds, rig_[i].model);
  });
}

/// Clears the masks outside the view of the bounds. Result: null for a camera without a usable
/// mask.
std::vector<const Mask*> TakeSilhouetteRepair::limit_to_view(SegmentedFrames& frames) const {
  std::vector<const Mask*> masks(views_.size(), nullptr);
  for (size_t c = 0; c < frames.size(); ++c) {
    if (!frames[c] || frames[c]->mask.size() != views_[c].size()) continue;
    frames[c]->mask = intersection_of(std::move(frames[c]->mask), views_[c]);
    masks[c] = &frames[c]->mask;
  }
  return masks;
}

recon::RepairedSilhouettes TakeSilhouetteRepair::compare(const SegmentedFrames& frames,
                                                         std::span<const Mask* const> masks,
                                                         const recon::NeighbourMasks& neighbours) {
  std::vector<const Frame*> images;
  for (size_t c = 0; c < frames.size(); ++c) images.push_back(masks[c] ? &frames[c]->raw : nullptr);
  return repair_.repair(masks, images, neighbours);
}

void TakeSilhouetteRepair::set_previous(int64_t pulse, SegmentedFrames frames) {
  previous_ = compare(frames, limit_to_view(frames), {}).alone;
  previous_pulse_ = pulse;
}

void TakeSilhouetteRepair::repair(int64_t pulse, SegmentedFrames& frames, SegmentedFrames& next) {
  const std::vector<const Mask*> masks = limit_to_view(frames);
  const std::vector<const Mask*> after = limit_to_view(next);
  std::vector<const Mask*> before;
  if (is_previous(pulse - 1)) {
    for (const auto& mask : previous_) before.push_back(mask ? &*mask : nullptr);
  }
  recon::RepairedSilhouettes repaired = compare(frames, masks, {.before = before, .after = after});
  for (const size_t c : repaired.shown_later) {
    frames[c]->raw = next[c]->raw;  // its label is that of the next pulse
    frames[c]->background_difference = next[c]->background_difference;
  }
  for (size_t c = 0; c < frames.size(); ++c) {
    if (masks[c] == nullptr) continue;
    if (repaired.masks[c]) {
      frames[c]->mask = *repaired.masks[c];
    } else {
      frames[c].reset();
    }
  }
  previous_ = std::move(repaired.alone);
  previous_pulse_ = pulse;
  for (const recon::SilhouetteFault& fault : repaired.faults) {
    faults_.push_back({pulse, rig_[fault.camera].name, fault});
  }
}

LivePulseRepair::LivePulseRepair(const Rig& rig, const recon::ReconstructOptions& options,
                                 std::vector<int64_t> pulses)
    : rig_(rig), repair_(rig, options), pulses_(std::move(pulses)) {}

void LivePulseRepair::repair(recon::FrameSet& set, SegmentedFrames& frames) {
  if (!std::ranges::binary_search(pulses_, set.pulse)) return;
  const auto repaired = repair_.repair(set);
  for (const recon::ReplacedMask& replaced : repaired->replaced) {
    auto& frame = frames[static_cast<size_t>(find_camera(rig_, replaced.camera))];
    const auto kept = std::ranges::find(set.frames, replaced.camera, &Frame::camera);
    if (kept != set.frames.end()) {
      frame->mask = *kept->mask;
    } else {
      frame.reset();
    }
  }
  for (const recon::SilhouetteFault& fault : repaired->faults) {
    faults_.push_back({set.pulse, rig_[fault.camera].name, fault});
  }
}

std::vector<std::string> fault_lines(const std::vector<PulseFault>& faults) {
  std::map<std::string, std::array<int64_t, 4>> counts;
  for (const PulseFault& fault : faults) {
    ++counts[fault.camera][static_cast<size_t>(fault.fault.kind)];
  }
  std::vector<std::string> lines;
  for (const auto& [camera, count] : counts) {
    const auto& [missing, phantom, whole, late] = count;
    std::string parts;
    const auto add = [&](int64_t n, const std::string& text) {
      if (n > 0) parts += (parts.empty() ? "" : ", ") + text;
    };
    add(missing, count_of(missing, "missing piece"));
    add(phantom, count_of(phantom, "phantom piece"));
    add(whole, "left out of " + count_of(whole, "frame"));
    add(late, count_of(late, "frame") + " a pulse late");
    lines.push_back(camera + ": " + parts);
  }
  return lines;
}

}  // namespace v3d::ctl
