// The functions v3d_motion_*() of codec/v3d_decoder.h.
#include <algorithm>
#include <cstddef>
#include <vector>

#include "codec/check.h"
#include "codec/motion_codec.h"
#include "codec/v3d_decoder.h"

struct v3d_motion {  // NOLINT(readability-identifier-naming): named by the C header
  std::vector<uint8_t> bytes;
  std::optional<v3d::codec::MotionReader> reader;  ///< of `bytes`
  std::vector<v3d_motion_segment> segments;
  v3d_motion_surface surface{};
  v3d_motion_pulse pulse{};
};

namespace {

using v3d::codec::value_or_on_bad_alloc;

template <class Rows>
auto first_of(const Rows& rows) -> decltype(rows.front().data()) {
  return rows.empty() ? nullptr : rows.front().data();
}

v3d_status open(v3d_motion& motion, const uint8_t* bytes, size_t size) {
  motion.bytes.assign(bytes, bytes + size);
  motion.reader = v3d::codec::MotionReader::open(motion.bytes);
  if (!motion.reader) return V3D_MALFORMED;
  for (const v3d::codec::MotionSegmentInfo& info : motion.reader->segments()) {
    motion.segments.push_back({info.pulses.size(), info.pulses.data(), info.key, info.vertices,
                               info.triangles, info.step_m});
  }
  return V3D_OK;
}

#ifdef __wasm32__
// codec/v3d_decoder.mjs reads the structures at these offsets.
static_assert(offsetof(v3d_motion_segment, pulse_numbers) == 4 &&
              offsetof(v3d_motion_segment, key) == 8 &&
              offsetof(v3d_motion_segment, step_m) == 24 &&
              offsetof(v3d_motion_surface, indices) == 16 &&
              offsetof(v3d_motion_pulse, vertices) == 8 &&
              offsetof(v3d_motion_pulse, confidences) == 20);
#endif

}  // namespace

v3d_status v3d_motion_open(v3d_motion** motion, const uint8_t* bytes, size_t size) {
  *motion = nullptr;
  auto* made =
      value_or_on_bad_alloc([] { return new v3d_motion; }, static_cast<v3d_motion*>(nullptr));
  if (made == nullptr) return V3D_OUT_OF_MEMORY;
  const auto call = [&] { return open(*made, bytes, size); };
  const v3d_status status = value_or_on_bad_alloc(call, V3D_OUT_OF_MEMORY);
  if (status == V3D_OK) {
    *motion = made;
  } else {
    delete made;
  }
  return status;
}

void v3d_motion_free(v3d_motion* motion) { delete motion; }

size_t v3d_motion_segments(const v3d_motion* motion) { return motion->segments.size(); }

const v3d_motion_segment* v3d_motion_segment_at(const v3d_motion* motion, size_t segment) {
  return segment < motion->segments.size() ? &motion->segments[segment] : nullptr;
}

const v3d_motion_surface* v3d_motion_surface_of(v3d_motion* motion, size_t segment) {
  const auto call = [&]() -> const v3d_motion_surface* {
    const v3d::codec::MotionTemplate* from = motion->reader->surface(segment);
    if (from == nullptr) return nullptr;
    motion->surface = {from->positions.size(), first_of(from->positions), first_of(from->colours),
                       from->triangles.size(), first_of(from->triangles)};
    return &motion->surface;
  };
  return value_or_on_bad_alloc(call, static_cast<const v3d_motion_surface*>(nullptr));
}

const v3d_motion_pulse* v3d_motion_decode(v3d_motion* motion, size_t segment, size_t index) {
  const auto call = [&]() -> const v3d_motion_pulse* {
    const v3d::codec::MotionPulse* from = motion->reader->decode(segment, index);
    if (from == nullptr) return nullptr;
    motion->pulse = {from->pulse, from->positions.size(), first_of(from->positions),
                     first_of(from->colours),
                     from->confidences.empty() ? nullptr : from->confidences.data()};
    return &motion->pulse;
  };
  return value_or_on_bad_alloc(call, static_cast<const v3d_motion_pulse*>(nullptr));
}
