/* Decoder of compact frames (docs/compact-frame.md) and of motion files (docs/motion-format.md),
 * for C and for languages that call C.
 *
 * It needs only the C++ runtime library and throws no exception. One thread at a time may use a
 * decoder; different decoders are independent. A decoder owns all data that is reached through it.
 * The data stays valid until the next v3d_decoder_decode() or v3d_decoder_free() of it. */
#ifndef V3D_CODEC_V3D_DECODER_H
#define V3D_CODEC_V3D_DECODER_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define V3D_API __attribute__((visibility("default")))

/* NOLINTBEGIN(readability-identifier-naming): names in the style of C libraries */

typedef struct v3d_decoder v3d_decoder;

typedef enum v3d_status {
  V3D_OK = 0,
  V3D_MALFORMED = 1, /* no compact frame of version 2 to 5, or damaged */
  V3D_NEEDS_REFERENCE =
      2, /* its reference is not the last decoded frame; continue at a key frame */
  V3D_OUT_OF_MEMORY = 3
} v3d_status;

/* What one camera sees of a frame. Since version 2.3. */
typedef struct v3d_camera_view {
  double axis[3];         /* viewing direction, world frame, a unit vector within 1e-4 */
  const uint8_t* colours; /* r, g, b of each vertex (sRGB), and 255; all 0 where it is not seen */
} v3d_camera_view;

typedef struct v3d_frame {
  int64_t pulse;
  int64_t exposure_ns; /* start of exposure, CLOCK_REALTIME of the studio; 0: unknown */
  int64_t key_pulse;   /* pulse of the key frame where decoding of this frame starts */
  float quality;       /* 0 to 1, more is better; not a number: unknown */
  double step_m;       /* step of the lattice of vertices, metres */
  double origin_m[3];  /* origin of this lattice, world frame, metres */
  size_t cameras;      /* number of cameras that took part; names are printable ASCII, ascending */
  const char* const* camera_names;
  size_t missing_cameras;
  size_t vertices;
  const float* positions; /* x, y, z of each vertex, metres, z up */
  const uint8_t* colours; /* r, g, b of each vertex (sRGB); NULL: the mesh has none */
  size_t triangles;
  const uint32_t* indices; /* three for each triangle, counter-clockwise seen from outside */
  size_t live_passes;      /* passes of the deformation within the live budget, 0 to 3 */
  const uint8_t* labels;   /* performer of each vertex, 0: unknown; NULL: the mesh has none */
  /* Of each camera, in the order of the names; NULL: none, or not wanted. Since version 2.3. */
  const v3d_camera_view* views;
} v3d_frame;

/* Makes a decoder; NULL when memory is exhausted. Release it with v3d_decoder_free(). */
V3D_API v3d_decoder* v3d_decoder_new(void);
/* Releases a decoder. NULL is allowed. */
V3D_API void v3d_decoder_free(v3d_decoder* decoder);

/* Decodes one compact frame. `bytes` are not needed after the call. V3D_MALFORMED and
 * V3D_NEEDS_REFERENCE leave the current frame as it is; after V3D_OUT_OF_MEMORY there is none until
 * the next V3D_OK. Memory stays below 2 GB for any bytes. */
V3D_API v3d_status v3d_decoder_decode(v3d_decoder* decoder, const uint8_t* bytes, size_t size);

/* Whether the next frames are decoded with the views of cameras that they have, which takes more
 * time and memory: at most 0.6 GB. At first they are not. Views begin at the next key frame at the
 * latest. Since version 2.3. */
V3D_API void v3d_decoder_want_views(v3d_decoder* decoder, int wanted);

/* The last decoded frame; NULL before the first, and after V3D_OUT_OF_MEMORY. */
V3D_API const v3d_frame* v3d_decoder_frame(const v3d_decoder* decoder);

/* Motion files: surfaces of constant triangles whose vertices move. Since version 2.2. */

typedef struct v3d_motion v3d_motion;

/* A run of pulses with the same triangles. */
typedef struct v3d_motion_segment {
  size_t pulses;
  const int64_t* pulse_numbers; /* increasing */
  size_t key;                   /* index of the pulse whose mesh became the template */
  size_t vertices;
  size_t triangles;
  double step_m; /* positions differ by at most half of it from those that were tracked */
} v3d_motion_segment;

/* The template of a segment. */
typedef struct v3d_motion_surface {
  size_t vertices;
  const float* positions; /* x, y, z of each vertex at the key pulse, metres, z up */
  /* r, g, b of each vertex (sRGB): the same at all pulses, or their mean where pulses have colours
   * of their own (v3d_motion_pulse); NULL: none */
  const uint8_t* colours;
  size_t triangles;
  const uint32_t* indices; /* three for each triangle, counter-clockwise seen from outside */
} v3d_motion_surface;

/* The vertices of a segment at one pulse. */
typedef struct v3d_motion_pulse {
  int64_t pulse;
  size_t vertices;
  const float* positions;     /* x, y, z of each vertex, metres, z up */
  const uint8_t* colours;     /* r, g, b of each vertex (sRGB) at this pulse; NULL: none */
  const uint8_t* confidences; /* of each vertex, 0: only predicted, to 255; NULL: none */
} v3d_motion_pulse;

/* Opens a motion file in memory. `bytes` are copied. Memory stays below 2 GB for any bytes beside
 * the copy. *motion is NULL unless the result is V3D_OK. Release it with v3d_motion_free(). */
V3D_API v3d_status v3d_motion_open(v3d_motion** motion, const uint8_t* bytes, size_t size);
/* Releases a motion file and all data that is reached through it. NULL is allowed. */
V3D_API void v3d_motion_free(v3d_motion* motion);

/* Number of segments, in the order of their pulses. A segment may begin at the last pulse of the
 * one before. */
V3D_API size_t v3d_motion_segments(const v3d_motion* motion);
/* A segment; NULL beyond the last. Valid until v3d_motion_free(). */
V3D_API const v3d_motion_segment* v3d_motion_segment_at(const v3d_motion* motion, size_t segment);
/* Decodes the template of a segment; NULL when it is damaged, and when memory is exhausted. Valid
 * until a call of this function or of v3d_motion_decode() with another segment. */
V3D_API const v3d_motion_surface* v3d_motion_surface_of(v3d_motion* motion, size_t segment);
/* Decodes a pulse by its index in the segment; NULL when it, or one that it needs, is damaged, and
 * when memory is exhausted. Any order is allowed; forward is fastest. Valid until the next call. */
V3D_API const v3d_motion_pulse* v3d_motion_decode(v3d_motion* motion, size_t segment, size_t index);

/* NOLINTEND(readability-identifier-naming) */

#ifdef __cplusplus
}
#endif

#endif
