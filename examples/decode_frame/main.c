/* Prints the pulse and the size of the mesh of a compact frame: decode_frame FILE. */
#include <stdio.h>
#include <v3d_decoder.h>

int main(int argc, char** argv) {
  FILE* file = argc == 2 ? fopen(argv[1], "rb") : NULL;
  if (file == NULL) {
    fprintf(stderr, "usage: decode_frame FILE, a file with one key frame\n");
    return 2;
  }
  static uint8_t bytes[1 << 24];
  const size_t size = fread(bytes, 1, sizeof bytes, file);
  fclose(file);

  v3d_decoder* decoder = v3d_decoder_new();
  const v3d_status status = v3d_decoder_decode(decoder, bytes, size);
  if (status == V3D_OK) {
    const v3d_frame* frame = v3d_decoder_frame(decoder);
    printf("pulse %lld: %zu vertices, %zu triangles\n", (long long)frame->pulse, frame->vertices,
           frame->triangles);
  } else {
    fprintf(stderr, "%s: not a compact key frame (status %d)\n", argv[1], (int)status);
  }
  v3d_decoder_free(decoder);
  return status == V3D_OK ? 0 : 2;
}
