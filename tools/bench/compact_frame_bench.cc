// Benchmark of the compact frame coder on consecutive pulses of the simulated performer, one core.
#include "pulses.h"
#include "rates.h"

namespace v3d::bench {
namespace {

/// Reports means over the pulses: one key frame and the frames after it.
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
      if (decoder.decode(frame) != DecodeStatus::kOk)
        state.SkipWithError("the frame cannot be decoded");
    }
  });
}

BENCHMARK_CAPTURE(encode, live, live_pulses)->Name("encode/10mm");
BENCHMARK_CAPTURE(decode, live, live_pulses)->Name("decode/10mm");
BENCHMARK_CAPTURE(encode, high, high_pulses)->Name("encode/10mm/deformed");
BENCHMARK_CAPTURE(decode, high, high_pulses)->Name("decode/10mm/deformed");

}  // namespace
}  // namespace v3d::bench
