#include "codec/v3d_decoder.h"

#include <cstddef>
#include <vector>

#include "codec/check.h"
#include "codec/frame_codec.h"

struct v3d_decoder {  // NOLINT(readability-identifier-naming): named by the C header
  v3d::codec::FrameDecoder decoder;
  std::vector<const char*> names;
  std::vector<v3d_camera_view> views;
  v3d_frame frame{};
  bool has_frame = false;
};

namespace {

void fill_views(v3d_decoder& decoder) {
  decoder.views.clear();
  for (const v3d::codec::CameraView& from : decoder.decoder.frame().cameras) {
    v3d_camera_view& to = decoder.views.emplace_back();
    for (int axis = 0; axis < 3; ++axis) {
      to.axis[axis] = static_cast<double>(from.axis[axis]) / v3d::codec::kAxisUnits;
    }
    to.colours = from.vertices.empty() ? nullptr : from.vertices.front().data();
  }
  decoder.frame.views = decoder.views.empty() ? nullptr : decoder.views.data();
}

void fill_frame(v3d_decoder& decoder) {
  const v3d::codec::DecodedFrame& from = decoder.decoder.frame();
  decoder.names.clear();
  for (const std::string& name : from.metadata.cameras) decoder.names.push_back(name.c_str());
  v3d_frame& to = decoder.frame;
  to.pulse = from.metadata.pulse;
  to.exposure_ns = from.metadata.exposure_ns;
  to.key_pulse = from.key_pulse;
  to.quality = from.metadata.quality;
  to.step_m = from.metadata.step;
  for (int axis = 0; axis < 3; ++axis) to.origin_m[axis] = from.metadata.origin[axis];
  to.cameras = decoder.names.size();
  to.camera_names = decoder.names.data();
  to.missing_cameras = static_cast<size_t>(from.metadata.missing);
  to.vertices = from.positions.size();
  to.positions = from.positions.empty() ? nullptr : from.positions.front().data();
  to.colours = from.colours.empty() ? nullptr : from.colours.front().data();
  to.triangles = from.triangles.size();
  to.indices = from.triangles.empty() ? nullptr : from.triangles.front().data();
  to.live_passes = static_cast<size_t>(from.metadata.live_passes);
  to.labels = from.labels.empty() ? nullptr : from.labels.data();
  fill_views(decoder);
  decoder.has_frame = true;
}

v3d_status status_of(v3d::codec::DecodeStatus status) {
  switch (status) {
    case v3d::codec::DecodeStatus::kOk:
      return V3D_OK;
    case v3d::codec::DecodeStatus::kNeedsReference:
      return V3D_NEEDS_REFERENCE;
    default:
      return V3D_MALFORMED;
  }
}

#ifdef __wasm32__
// codec/v3d_decoder.mjs reads the frame at these offsets.
static_assert(offsetof(v3d_frame, quality) == 24 && offsetof(v3d_frame, step_m) == 32 &&
              offsetof(v3d_frame, origin_m) == 40 && offsetof(v3d_frame, cameras) == 64 &&
              offsetof(v3d_frame, vertices) == 76 && offsetof(v3d_frame, indices) == 92 &&
              offsetof(v3d_frame, live_passes) == 96 && offsetof(v3d_frame, labels) == 100 &&
              offsetof(v3d_frame, views) == 104 && sizeof(v3d_camera_view) == 32 &&
              offsetof(v3d_camera_view, colours) == 24);
#endif

}  // namespace

v3d_decoder* v3d_decoder_new() {
  return v3d::codec::value_or_on_bad_alloc([] { return new v3d_decoder; },
                                           static_cast<v3d_decoder*>(nullptr));
}

void v3d_decoder_free(v3d_decoder* decoder) { delete decoder; }

v3d_status v3d_decoder_decode(v3d_decoder* decoder, const uint8_t* bytes, size_t size) {
  const auto decode = [&] {
    const v3d_status status = status_of(decoder->decoder.decode({bytes, size}));
    if (status == V3D_OK) fill_frame(*decoder);
    return status;
  };
  const v3d_status status = v3d::codec::value_or_on_bad_alloc(decode, V3D_OUT_OF_MEMORY);
  // The decoder may have released what the current frame points to.
  if (status == V3D_OUT_OF_MEMORY) decoder->has_frame = false;
  return status;
}

void v3d_decoder_want_views(v3d_decoder* decoder, int wanted) {
  decoder->decoder.enable_cameras(wanted != 0);
}

const v3d_frame* v3d_decoder_frame(const v3d_decoder* decoder) {
  return decoder->has_frame ? &decoder->frame : nullptr;
}
