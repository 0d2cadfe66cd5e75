// Tracked surfaces for tests.
#pragma once

#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include "codec/motion_codec.h"

namespace v3d::codec {

/// A closed tube of `rings` x `sides` vertices that turns, bends and moves at 25 pulses a second.
inline MotionSegment moving_tube(size_t pulses, uint32_t rings = 20, uint32_t sides = 12) {
  MotionSegment s;
  for (uint32_t r = 0; r + 1 < rings; ++r) {
    for (uint32_t i = 0; i < sides; ++i) {
      const uint32_t a = r * sides + i, b = r * sides + (i + 1) % sides;
      s.triangles.push_back({a, b, a + sides});
      s.triangles.push_back({b, b + sides, a + sides});
    }
  }
  for (size_t p = 0; p < pulses; ++p) {
    const double time = static_cast<double>(p) / 25;
    s.pulses.push_back(static_cast<int64_t>(100 + p));
    auto& positions = s.positions.emplace_back();
    for (uint32_t v = 0; v < rings * sides; ++v) {
      const double along = 0.02 * (v / sides);
      const double angle = 2 * std::numbers::pi * (v % sides) / sides + 2 * time;
      const double radius = 0.1 + 0.02 * std::sin(20 * along + 3 * time);
      const double bend = 0.3 * along * along * std::sin(5 * time);
      positions.push_back({static_cast<float>(1 + radius * std::cos(angle) + bend),
                           static_cast<float>(radius * std::sin(angle) + 0.5 * time),
                           static_cast<float>(1 + along)});
    }
  }
  s.key = pulses / 2;
  return s;
}

/// Sets colours that follow the vertices, with noise of `spread` in each pulse; and confidences.
inline void paint(MotionSegment& s, int spread, uint32_t seed = 1) {
  std::mt19937 random(seed);
  s.colours.resize(s.pulses.size());
  s.confidences.resize(s.pulses.size());
  for (size_t p = 0; p < s.pulses.size(); ++p) {
    for (size_t v = 0; v < s.positions[p].size(); ++v) {
      const auto level = [&](double wave) {
        const auto noise = static_cast<int>(random() % static_cast<uint32_t>(2 * spread + 1));
        return static_cast<uint8_t>(120 + 90 * std::sin(wave * static_cast<double>(v)) + noise -
                                    spread);
      };
      s.colours[p].push_back({level(0.1), level(0.07), level(0.2)});
      s.confidences[p].push_back(static_cast<uint8_t>(v % 7 == 0 ? 0 : 40 * (v % 7) + p % 3));
    }
  }
}

/// Any triangles, degenerate and non-manifold ones included, with vertices that jump.
inline MotionSegment random_segment(uint32_t seed, size_t pulses, uint32_t vertices,
                                    size_t triangles) {
  std::mt19937 random(seed);
  MotionSegment s;
  for (size_t t = 0; t < triangles && vertices > 0; ++t) {
    s.triangles.push_back({static_cast<uint32_t>(random() % vertices),
                           static_cast<uint32_t>(random() % vertices),
                           static_cast<uint32_t>(random() % vertices)});
  }
  for (size_t p = 0; p < pulses; ++p) {
    s.pulses.push_back(static_cast<int64_t>(3 * p));
    auto& positions = s.positions.emplace_back();
    const auto metres = [&] { return static_cast<float>(random() % 100000) / 1000 - 50; };
    for (uint32_t v = 0; v < vertices; ++v) positions.push_back({metres(), metres(), metres()});
  }
  s.key = pulses > 0 ? seed % pulses : 0;
  return s;
}

/// A motion file of these segments. Requires that all can be encoded.
inline std::vector<uint8_t> motion_file(const std::vector<MotionSegment>& segments,
                                        const MotionEncoderOptions& options = {}) {
  std::vector<uint8_t> file = MotionWriter::header();
  MotionWriter writer(options);
  for (const MotionSegment& segment : segments) {
    const EncodedMotion encoded = writer.add(segment).value();
    file.insert(file.end(), encoded.bytes.begin(), encoded.bytes.end());
  }
  return file;
}

}  // namespace v3d::codec
