#include "v3dctl/mask_mending.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <map>

#include "base/mask_shape.h"
#include "v3dctl/options.h"
#include "v3dctl/working_space.h"

namespace v3d::ctl {
namespace {

/// Voxels along the longest edge of the space: as fine as faults are looked for.
constexpr double kVoxels = 220;

double voxel_for(const ReconstructOptions& options) {
  const Box& box = options.bounds;
  return std::max(options.voxel_m, (box.max - box.min).maxCoeff() / kVoxels);
}

}  // namespace

std::string name(SilhouetteFaultKind kind) {
  switch (kind) {
    case SilhouetteFaultKind::kMissingPiece:
      return "missing piece";
    case SilhouetteFaultKind::kPhantomPiece:
      return "phantom piece";
    case SilhouetteFaultKind::kWholeCamera:
      return "whole camera";
  }
  return "";
}

MaskMending::MaskMending(const Rig& rig, const ReconstructOptions& options)
    : rig_(rig),
      mender_(rig, options.bounds, voxel_for(options), options.min_views),
      views_(rig.size()) {
  tbb::parallel_for(size_t{0}, rig.size(),
                    [&](size_t i) { views_[i] = view_of(options.bounds, rig_[i].model); });
}

void MaskMending::mend(int64_t pulse, std::vector<std::optional<SegmentedFrame>>& frames) {
  std::vector<const Mask*> masks;
  std::vector<const Frame*> images;
  for (size_t c = 0; c < frames.size(); ++c) {
    const bool usable = frames[c] && frames[c]->mask.size() == views_[c].size();
    if (usable) frames[c]->mask = both(std::move(frames[c]->mask), views_[c]);
    masks.push_back(usable ? &frames[c]->mask : nullptr);
    images.push_back(usable ? &frames[c]->raw : nullptr);
  }
  MendedSilhouettes mended = mender_.mend(masks, images);
  for (size_t c = 0; c < frames.size(); ++c) {
    if (masks[c] == nullptr) continue;
    if (mended.masks[c]) {
      frames[c]->mask = *std::move(mended.masks[c]);
    } else {
      frames[c].reset();
    }
  }
  for (const SilhouetteFault& fault : mended.faults) {
    faults_.push_back({pulse, rig_[fault.camera].name, fault});
  }
}

std::vector<std::string> lines_of(const std::vector<PulseFault>& faults) {
  std::map<std::string, std::array<int64_t, 3>> counts;
  for (const PulseFault& fault : faults) {
    ++counts[fault.camera][static_cast<size_t>(fault.fault.kind)];
  }
  std::vector<std::string> lines;
  for (const auto& [camera, count] : counts) {
    const auto& [missing, phantom, whole] = count;
    std::string parts;
    const auto add = [&](int64_t n, const std::string& text) {
      if (n > 0) parts += (parts.empty() ? "" : ", ") + text;
    };
    add(missing, count_of(missing, "missing piece"));
    add(phantom, count_of(phantom, "phantom piece"));
    add(whole, "left out of " + count_of(whole, "frame"));
    lines.push_back(camera + ": " + parts);
  }
  return lines;
}

}  // namespace v3d::ctl
