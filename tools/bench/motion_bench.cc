// Encoder and decoder of tracked surfaces. The surface is the simulated performer, simplified to
// 30,000 triangles, at 25 pulses a second during the cut.
#include <benchmark/benchmark.h>
#include <meshoptimizer.h>

#include <algorithm>
#include <random>

#include "codec/motion_codec.h"
#include "sim/rendering/scene.h"

namespace v3d::bench {
namespace {

constexpr size_t kTriangles = 30000;
constexpr int kPulses = 51;

/// Vertices of the performer that remain, and their triangles.
struct Simplified {
  std::vector<uint32_t> vertices;
  std::vector<codec::VertexTriangle> triangles;
};

Simplified simplified(const Mesh& mesh) {
  std::vector<uint32_t> indices(3 * mesh.triangles.size());
  const uint32_t* all = mesh.triangles[0].data();
  indices.resize(meshopt_simplify(indices.data(), all, indices.size(), mesh.vertices[0].data(),
                                  mesh.vertices.size(), sizeof mesh.vertices[0], 3 * kTriangles,
                                  1.0F, 0, nullptr));
  Simplified result;
  result.vertices = indices;
  std::sort(result.vertices.begin(), result.vertices.end());
  result.vertices.erase(std::unique(result.vertices.begin(), result.vertices.end()),
                        result.vertices.end());
  for (uint32_t& index : indices) {
    const auto at = std::lower_bound(result.vertices.begin(), result.vertices.end(), index);
    index = static_cast<uint32_t>(at - result.vertices.begin());
  }
  for (size_t i = 0; i < indices.size(); i += 3) {
    result.triangles.push_back({indices[i], indices[i + 1], indices[i + 2]});
  }
  return result;
}

/// Noise of tracking: `noise_m` along each axis, and 2 levels of colour.
codec::MotionSegment performer(double noise_m) {
  codec::MotionSegment s;
  std::mt19937 random(1);
  std::normal_distribution<double> normal;
  Simplified kept;
  for (int p = 0; p < kPulses; ++p) {
    const Mesh mesh = sim::performer_at(1.0 + p / 25.0, 1);
    if (p == 0) kept = simplified(mesh);
    s.pulses.push_back(p);
    auto& positions = s.positions.emplace_back();
    auto& colours = s.colours.emplace_back();
    auto& confidences = s.confidences.emplace_back();
    for (const uint32_t v : kept.vertices) {
      const auto metres = [&](int axis) {
        return static_cast<float>(mesh.vertices[v][axis] + noise_m * normal(random));
      };
      const auto level = [&](uint8_t value) {
        const double noisy = value + (noise_m > 0 ? 2 * normal(random) : 0);
        return static_cast<uint8_t>(std::clamp(noisy + 0.5, 0.0, 255.0));
      };
      const Rgb8& c = mesh.colours[v];
      positions.push_back({metres(0), metres(1), metres(2)});
      colours.push_back({level(c.r), level(c.g), level(c.b)});
      // The front is seen well, the rest less.
      const double seen = 150 + 300 * (mesh.vertices[v].x() - mesh.vertices[0].x());
      confidences.push_back(static_cast<uint8_t>(std::clamp(seen, 0.0, 255.0)));
    }
  }
  s.key = kPulses / 2;
  s.triangles = kept.triangles;
  return s;
}

void report(benchmark::State& state, const codec::EncodedMotion& encoded) {
  const auto for_pulse = [](size_t bytes) { return static_cast<double>(bytes) / kPulses; };
  const codec::MotionBytes& parts = encoded.parts;
  state.counters["vertices"] = static_cast<double>(encoded.order.size());
  state.counters["bytes"] = for_pulse(encoded.bytes.size());
  state.counters["triangle_bytes"] = static_cast<double>(parts.triangles);
  state.counters["template_bytes"] =
      static_cast<double>(parts.template_positions + parts.template_colours);
  state.counters["position_bytes"] = for_pulse(parts.positions);
  state.counters["colour_bytes"] = for_pulse(parts.colours);
  state.counters["confidence_bytes"] = for_pulse(parts.confidences);
}

void encode_motion(benchmark::State& state, double step_m, double noise_m) {
  const codec::MotionSegment segment = performer(noise_m);
  for (auto _ : state) {
    const auto encoded = codec::encode_motion(segment, {.step_m = step_m});
    report(state, encoded.value());
  }
  state.SetItemsProcessed(state.iterations() * kPulses);
}

std::vector<uint8_t> motion_file(double step_m, double noise_m) {
  codec::MotionWriter writer({.step_m = step_m});
  std::vector<uint8_t> file = codec::MotionWriter::header();
  const auto encoded = writer.add(performer(noise_m)).value();
  file.insert(file.end(), encoded.bytes.begin(), encoded.bytes.end());
  return file;
}

/// Plays the segment forward, its template included.
void decode_motion(benchmark::State& state, double step_m, double noise_m) {
  const std::vector<uint8_t> file = motion_file(step_m, noise_m);
  for (auto _ : state) {
    auto reader = codec::MotionReader::open(file);
    for (size_t p = 0; p < kPulses; ++p) benchmark::DoNotOptimize(reader->decode(0, p));
  }
  state.SetItemsProcessed(state.iterations() * kPulses);
}

/// Decodes one pulse after the file was opened, its template included.
void seek_motion(benchmark::State& state, double step_m, double noise_m) {
  const std::vector<uint8_t> file = motion_file(step_m, noise_m);
  for (auto _ : state) {
    auto reader = codec::MotionReader::open(file);
    benchmark::DoNotOptimize(reader->decode(0, 40));
  }
}

BENCHMARK_CAPTURE(encode_motion, exact_500um, 0.0005, 0)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(encode_motion, exact_100um, 0.0001, 0)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(encode_motion, noise_200um_500um, 0.0005, 0.0002)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(encode_motion, noise_200um_100um, 0.0001, 0.0002)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(encode_motion, noise_500um_500um, 0.0005, 0.0005)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(encode_motion, noise_500um_100um, 0.0001, 0.0005)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(decode_motion, noise_200um_500um, 0.0005, 0.0002)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(decode_motion, noise_200um_100um, 0.0001, 0.0002)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(seek_motion, noise_200um_500um, 0.0005, 0.0002)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace v3d::bench
