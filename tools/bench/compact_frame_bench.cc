// The compact frame's coder on pulses of the simulated performer that follow each other, one core.
#include <cmath>

#include "codec/frame_codec.h"
#include "rates.h"
#include "recon/marching_cubes.h"
#include "recon/texture.h"
#include "sim/film.h"
#include "workload.h"

namespace v3d::bench {
namespace {

constexpr int kPulses = 4;
constexpr double kVoxelM = 0.01;

struct Pulse {
  SparseVolume volume;
  Mesh mesh;
  std::vector<VertexColour> colours;
  std::vector<VertexPosition> positions;
};

FrameSet shoot(sim::Film& film, int pulse) {
  const std::vector<Image> images = film.shoot_all(kInstantSeconds + pulse / 25.0, kPlates + pulse);
  FrameSet set;
  for (int c = 0; c < kCameras; ++c) {
    const Mask mask = Segmenter(background_models()[c], {}).segment(images[c].view());
    set.frames.push_back(observe(rig()[c].name, {}, images[c].view(), mask));
  }
  return set;
}

Pulse make_pulse(const FrameSet& set, bool deformed) {
  std::vector<const Mask*> masks;
  std::vector<TextureCamera> colouring;
  std::vector<DeformCamera> deforming;
  for (int c = 0; c < kCameras; ++c) {
    masks.push_back(&*set.frames[c].mask);
    colouring.push_back({&rig()[c].model, &set.frames[c]});
    deforming.push_back({&rig()[c].model, &set.frames[c]});
  }
  Pulse pulse;
  pulse.volume = intersector(kVoxelM).intersect(masks);
  pulse.mesh = marching_cubes(pulse.volume);
  if (deformed) {
    DeformOptions options;
    options.voxel_m = kVoxelM;
    Deformer(options).run(deforming, pulse.mesh);
    for (const auto& v : pulse.mesh.vertices) pulse.positions.push_back({v.x(), v.y(), v.z()});
  }
  pulse.mesh.colours = colour_vertices(pulse.mesh, colouring, {}).colours;
  for (const Rgb8 c : pulse.mesh.colours) pulse.colours.push_back({c.r, c.g, c.b});
  return pulse;
}

std::vector<Pulse> make_pulses(bool deformed) {
  sim::Film film(rig(), {.seed = kSeed});
  std::vector<Pulse> pulses;
  for (int n = 0; n < kPulses; ++n) pulses.push_back(make_pulse(shoot(film, n), deformed));
  return pulses;
}

const std::vector<Pulse>& live_pulses() {
  static const auto kMade = make_pulses(false);
  return kMade;
}
const std::vector<Pulse>& high_pulses() {
  static const auto kMade = make_pulses(true);
  return kMade;
}

std::vector<uint8_t> encode_pulse(FrameEncoder& encoder, const Pulse& pulse, int64_t number) {
  const VoxelGrid& grid = pulse.volume.grid();
  const BrickVolume volume = pulse.volume.view();
  FrameContent content;
  content.facts.pulse = number;
  content.facts.cameras = {rig()[0].name};
  content.facts.origin = {grid.origin.x(), grid.origin.y(), grid.origin.z()};
  content.facts.step = grid.voxel_m / 2;
  content.volume = &volume;
  content.positions = pulse.positions;
  content.colours = pulse.colours;
  return encoder.encode(content).value();
}

double psnr_db(const std::vector<VertexColour>& a, const std::vector<VertexColour>& b) {
  double sum = 0;
  for (size_t v = 0; v < a.size(); ++v) {
    for (int c = 0; c < 3; ++c) sum += (a[v][c] - b[v][c]) * (a[v][c] - b[v][c]);
  }
  return 10 * std::log10(255 * 255 * 3 * static_cast<double>(a.size()) / sum);
}

/// Means over the pulses: one key frame and those that follow it.
void report_sizes(benchmark::State& state, const std::vector<Pulse>& pulses) {
  FrameEncoder encoder({});
  double vertices = 0, triangles = 0, psnr = 0, between = 0;
  FrameBytes sum;
  for (int n = 0; n < kPulses; ++n) {
    const auto bytes = static_cast<double>(encode_pulse(encoder, pulses[n], n).size());
    n == 0 ? void(state.counters["key_bytes"] = bytes) : void(between += bytes);
    const FrameBytes parts = encoder.bytes();
    sum.shape += parts.shape;
    sum.displacements += parts.displacements;
    sum.colours += parts.colours;
    vertices += static_cast<double>(pulses[n].mesh.vertices.size());
    triangles += static_cast<double>(pulses[n].mesh.triangles.size());
    psnr += psnr_db(encoder.decoded().colours, pulses[n].colours);
  }
  state.counters["frame_bytes"] = between / (kPulses - 1);
  state.counters["triangles"] = triangles / kPulses;
  state.counters["shape_bits"] = 8 * static_cast<double>(sum.shape) / vertices;
  state.counters["move_bits"] = 8 * static_cast<double>(sum.displacements) / vertices;
  state.counters["colour_bits"] = 8 * static_cast<double>(sum.colours) / vertices;
  state.counters["psnr_db"] = psnr / kPulses;
}

void encode(benchmark::State& state, const std::vector<Pulse>& (*made)()) {
  const std::vector<Pulse>& pulses = made();
  FrameEncoder encoder({});
  int64_t number = 0;
  measure(state, kPulses, 0, [&] {
    for (const Pulse& pulse : pulses) {
      benchmark::DoNotOptimize(encode_pulse(encoder, pulse, number++));
    }
  });
  report_sizes(state, pulses);
}

void decode(benchmark::State& state, const std::vector<Pulse>& (*pulses)()) {
  FrameEncoder encoder({});
  std::vector<std::vector<uint8_t>> frames;
  double bytes = 0;
  for (int n = 0; n < kPulses; ++n) {
    frames.push_back(encode_pulse(encoder, pulses()[n], n));
    bytes += static_cast<double>(frames.back().size());
  }
  FrameDecoder decoder;
  measure(state, kPulses, bytes, [&] {
    for (const auto& frame : frames) {
      if (decoder.decode(frame) != DecodeStatus::kOk) state.SkipWithError("not decoded");
    }
  });
}

BENCHMARK_CAPTURE(encode, live, live_pulses)->Name("encode/10mm");
BENCHMARK_CAPTURE(decode, live, live_pulses)->Name("decode/10mm");
BENCHMARK_CAPTURE(encode, high, high_pulses)->Name("encode/10mm/deformed");
BENCHMARK_CAPTURE(decode, high, high_pulses)->Name("decode/10mm/deformed");

}  // namespace
}  // namespace v3d::bench
