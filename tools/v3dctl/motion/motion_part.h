// A tracked segment as a part of motion.v3d, with its measurements.
#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "codec/motion_codec.h"
#include "recon/motion/motion_tracker.h"
#include "v3dctl/motion/take_motion.h"

namespace v3d::ctl {

struct MotionPart {
  std::vector<int64_t> pulses;  ///< with the one that belongs to the next segment
  std::string bytes;  ///< in the file; empty: the segment exceeds the limits of the format
  int64_t template_bytes = 0, position_bytes = 0, colour_bytes = 0, confidence_bytes = 0;
  TrackedSegmentReport report;
  /// As TrackReport::without_images; not the pulse that belongs to the next segment.
  std::vector<int64_t> without_images;
};

/// A segment as MotionWriter takes it.
struct MotionContent {
  codec::MotionSegment motion;
  std::vector<int64_t> without_images;  ///< as MotionPart
};

/// A pulse without images has the colours of the nearest pulse with images; without any, all have
/// those of the template.
MotionContent content_of(const recon::TrackedSegment& segment);

/// `encoded`: the content of `segment`.
MotionPart part_of(const recon::TrackedSegment& segment, const codec::EncodedMotion& encoded,
                   std::vector<int64_t> without_images);
/// Encodes the segment with steps of `step_m`.
MotionPart encoded_part(const recon::TrackedSegment& segment, double step_m);

/// All but the bytes as JSON, and back. The second throws nlohmann::json::exception for other JSON.
nlohmann::ordered_json part_to_json(const MotionPart& part);
MotionPart part_from_json(const nlohmann::ordered_json& json);

}  // namespace v3d::ctl
