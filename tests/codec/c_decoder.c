/* Test that codec/v3d_decoder.h compiles as C. */
#include "codec/v3d_decoder.h"

/* Number of vertices of a frame; 0 unless the frame is valid. */
size_t vertices_in_c(const uint8_t* bytes, size_t size) {
  v3d_decoder* decoder = v3d_decoder_new();
  const v3d_status status = v3d_decoder_decode(decoder, bytes, size);
  const v3d_frame* frame = v3d_decoder_frame(decoder);
  const size_t vertices = status == V3D_OK ? frame->vertices : 0;
  v3d_decoder_free(decoder);
  return vertices;
}

/* Number of vertices that a camera sees in a frame; 0 unless the frame is valid and has views. */
size_t seen_in_c(const uint8_t* bytes, size_t size, size_t camera) {
  v3d_decoder* decoder = v3d_decoder_new();
  size_t seen = 0;
  v3d_decoder_want_views(decoder, 1);
  if (v3d_decoder_decode(decoder, bytes, size) == V3D_OK) {
    const v3d_frame* frame = v3d_decoder_frame(decoder);
    for (size_t v = 0; frame->views != NULL && v < frame->vertices; ++v) {
      seen += frame->views[camera].colours[4 * v + 3] != 0;
    }
  }
  v3d_decoder_free(decoder);
  return seen;
}

/* Number of vertices of the last pulse of the first segment of a motion file; 0 unless it is valid.
 */
size_t motion_vertices_in_c(const uint8_t* bytes, size_t size) {
  v3d_motion* motion = NULL;
  if (v3d_motion_open(&motion, bytes, size) != V3D_OK) return 0;
  const v3d_motion_segment* segment = v3d_motion_segment_at(motion, 0);
  const v3d_motion_pulse* pulse = v3d_motion_decode(motion, 0, segment->pulses - 1);
  const size_t vertices = pulse == NULL ? 0 : pulse->vertices;
  v3d_motion_free(motion);
  return vertices;
}
