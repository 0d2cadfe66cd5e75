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
