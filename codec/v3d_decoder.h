/* Decoder of compact frames (docs/compact-frame.md), for C and for whatever calls C.
 *
 * Needs no library but the C++ runtime. No exception leaves it. A decoder belongs to one thread at
 * a time; different decoders are independent. Everything reached through a decoder belongs to it
 * and stays valid until the next call of v3d_decoder_decode() with it or of v3d_decoder_free(). */
#ifndef V3D_CODEC_V3D_DECODER_H
#define V3D_CODEC_V3D_DECODER_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define V3D_API __attribute__((visibility("default")))

/* NOLINTBEGIN(readability-identifier-naming): named as C libraries name things */

typedef struct v3d_decoder v3d_decoder;

typedef enum v3d_status {
  V3D_OK = 0,
  V3D_MALFORMED = 1, /* no compact frame of version 2, or damaged */
  V3D_NEEDS_REFERENCE =
      2, /* made for a frame that was not the last one decoded: go on at a key frame */
  V3D_OUT_OF_MEMORY = 3
} v3d_status;

typedef struct v3d_frame {
  int64_t pulse;
  int64_t exposure_ns; /* start of exposure, CLOCK_REALTIME of the studio; 0: unknown */
  int64_t key_pulse;   /* of the key frame that decoding this one begins at */
  float quality;       /* 0 to 1, more is better; not a number: unknown */
  double step_m;       /* vertices lie on a lattice of that step ... */
  double origin_m[3];  /* ... from here */
  size_t cameras;      /* that took part, and their names in ascending order, ended by 0 */
  const char* const* camera_names;
  size_t missing_cameras;
  size_t vertices;
  const float* positions; /* x, y, z of each vertex: metres, z up */
  const uint8_t* colours; /* r, g, b of each vertex (sRGB); NULL: the mesh has none */
  size_t triangles;
  const uint32_t* indices; /* three of each triangle, counter-clockwise seen from outside */
} v3d_frame;

/* NULL when there is no memory. To be given to v3d_decoder_free(). */
V3D_API v3d_decoder* v3d_decoder_new(void);
/* NULL is allowed. */
V3D_API void v3d_decoder_free(v3d_decoder* decoder);

/* Decodes one compact frame. `bytes` are not needed afterwards. Unless V3D_OK, the frame decoded
 * before stays. Whatever the bytes, memory stays below 2 GB. */
V3D_API v3d_status v3d_decoder_decode(v3d_decoder* decoder, const uint8_t* bytes, size_t size);

/* The last frame that was decoded; NULL before the first. */
V3D_API const v3d_frame* v3d_decoder_frame(const v3d_decoder* decoder);

/* NOLINTEND(readability-identifier-naming) */

#ifdef __cplusplus
}
#endif

#endif
