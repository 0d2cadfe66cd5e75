// Test frames: surfaces of volumes, coloured and displaced.
#pragma once

#include <cmath>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "codec/byte_stream.h"
#include "codec/frame_codec.h"
#include "recon/hull/sparse_volume.h"
#include "tests/recon/volumes.h"

namespace v3d::codec {

inline uint32_t hash(uint32_t a, uint32_t b) {
  uint32_t h = a * 73856093U ^ b * 83492791U;
  h = (h ^ h >> 15) * 0x2C1B3C6DU;
  h = (h ^ h >> 12) * 0x297A2D39U;
  return h ^ h >> 15;
}

/// Random voxels by a hash; the density is from sparse to nearly solid.
inline recon::SparseVolume dust(const recon::VoxelGrid& grid, uint32_t seed,
                                uint32_t per_thousand) {
  return make_volume(grid, [&](int i, int j, int k) {
    const auto voxel = static_cast<uint32_t>(i + 1000 * (j + 1000 * k));
    return hash(voxel, seed) % 1000 < per_thousand;
  });
}

inline recon::SparseVolume ball(double radius, double middle_x = 25) {
  return recon::make_volume(recon::small_grid(50, 50, 50), [&](int i, int j, int k) {
    return std::hypot(i - middle_x, j - 25, k - 25) <= radius;
  });
}

/// Content of a frame, and its marching cubes mesh.
struct Scene {
  recon::SparseVolume volume;
  BrickVolume view;
  Mesh mesh;
  std::vector<VertexColour> colours;
  std::vector<VertexPosition> moved;

  explicit Scene(recon::SparseVolume of) : volume(std::move(of)), mesh(marching_cubes(volume)) {
    view = volume.view();
  }

  /// Sets smooth colours with a little noise.
  void paint(uint32_t seed) {
    for (size_t v = 0; v < mesh.vertices.size(); ++v) {
      const auto p = mesh.vertices[v];
      const auto level = [&](float wave) {
        const double smooth = 128 + 90 * std::sin(wave);
        return static_cast<uint8_t>(smooth + hash(static_cast<uint32_t>(v), seed) % 16);
      };
      colours.push_back({level(20 * p.x()), level(15 * p.y()), level(30 * p.z())});
    }
  }

  void move(double max_m) {
    for (size_t v = 0; v < mesh.vertices.size(); ++v) {
      VertexPosition& p = moved.emplace_back();
      for (int axis = 0; axis < 3; ++axis) {
        const double part = hash(static_cast<uint32_t>(3 * v + axis), 7) % 2001 / 1000.0 - 1;
        p[axis] = static_cast<float>(mesh.vertices[v][axis] + max_m * part);
      }
    }
  }

  FrameContent content(int64_t pulse) const {
    FrameContent c;
    c.metadata.pulse = pulse;
    c.metadata.exposure_ns = 1'700'000'000'000'000'000 + pulse;
    c.metadata.cameras = {"cam01", "cam02"};
    c.metadata.missing = 3;
    c.metadata.quality = 0.75F;
    const recon::VoxelGrid& grid = volume.grid();
    c.metadata.origin = {grid.origin.x(), grid.origin.y(), grid.origin.z()};
    c.metadata.step = grid.voxel_m / 2;
    c.volume = &view;
    c.positions = moved;
    c.colours = colours;
    return c;
  }
};

/// Encoded frames of a moving ball, from pulse 8 on, with a key frame every 4 pulses. The pulse
/// `left_out` is not encoded.
inline std::vector<std::vector<uint8_t>> moving_ball(int frames, int left_out = -1) {
  FrameEncoder encoder({.key_every = 4});
  std::vector<std::vector<uint8_t>> all;
  for (int n = 0; n < frames; ++n) {
    Scene scene(ball(8, 25 + n % 5));
    scene.paint(3);
    if (8 + n != left_out) all.push_back(encoder.encode(scene.content(8 + n)).value());
  }
  return all;
}

/// The frame with a corrected checksum, as an attacker would send it.
inline std::vector<uint8_t> with_valid_checksum(std::vector<uint8_t> frame) {
  const uint32_t sum = crc32(std::span(frame).subspan(16));
  for (int n = 0; n < 4; ++n) frame[12 + n] = static_cast<uint8_t>(sum >> (8 * n));
  return frame;
}

}  // namespace v3d::codec
