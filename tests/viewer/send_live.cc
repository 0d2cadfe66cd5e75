// usage: viewer_live LCM_URL PULSES RATE_HZ LOST_PERCENT SEED: sends live meshes as v3d-recond does
// and leaves some out, as a lossy network would. Each mesh is a ball whose size and colour identify
// its pulse (live_test.mjs computes the same). Prints a line for each pulse: number, "key" or
// "inter", "sent" or "lost", and its edge, ms since 1970. Before a loss after sent meshes it prints
// "pause" and waits for a line of input.
#include <cstdio>
#include <cstdlib>
#include <random>
#include <thread>

#include "base/core/time.h"
#include "codec/frame_header.h"
#include "daemon/bus/bus.h"
#include "tests/viewer/ball_frames.h"

namespace v3d {
namespace {

constexpr int kKeyEvery = 10;

/// The colour of a pulse. Pulses near each other have clearly different colours.
codec::VertexColour colour_of(int64_t pulse) {
  const auto level = [&](int64_t factor) {
    return static_cast<uint8_t>(40 + pulse * factor % 170);
  };
  return {level(67), level(101), level(139)};
}

/// The radius of a pulse, in voxels. It is constant for five pulses, so that frames between key
/// frames can be predicted from earlier ones.
double radius_of(int64_t pulse) { return static_cast<double>(12 + pulse / 5 % 8); }

wire::MeshMessage message_of(int64_t pulse, RealtimeInstant edge, std::vector<uint8_t> compact) {
  wire::MeshMessage message;
  message.sent = Realtime::now();
  message.seq = pulse;
  message.take = "lossy";
  message.pulse = pulse;
  message.pulse_edge = edge;
  message.cameras = 1;
  message.compact = std::move(compact);
  return message;
}

/// Returns false at the end of the input.
bool wait_for_input() {
  std::printf("pause\n");
  std::fflush(stdout);
  return std::getchar() != EOF;
}

void send(const std::string& url, int64_t pulses, double rate_hz, double lost_percent,
          uint32_t seed) {
  bus::Bus bus(url);
  codec::FrameEncoder encoder({.key_every = kKeyEvery});
  std::mt19937 random(seed);
  MonotonicInstant due = Monotonic::now();
  bool was_sent = false;
  for (int64_t pulse = 0; pulse < pulses; ++pulse) {
    codec::Scene scene(codec::ball(radius_of(pulse)));
    auto compact = *encoder.encode(ball_frame(scene, pulse, colour_of(pulse)));
    const bool key = !codec::read_header(compact)->is(codec::FrameHeader::kInter);
    const bool lost = random() % 10'000 < lost_percent * 100;
    if (lost && was_sent) {
      if (!wait_for_input()) return;
      due = Monotonic::now();
    }
    was_sent = !lost;
    const RealtimeInstant edge = Realtime::now();
    if (!lost) {
      bus.publish(wire::kMeshChannel, wire::encode(message_of(pulse, edge, std::move(compact))));
    }
    std::printf("%lld %s %s %.3f\n", static_cast<long long>(pulse), key ? "key" : "inter",
                lost ? "lost" : "sent", static_cast<double>(to_ns(edge)) * 1e-6);
    std::fflush(stdout);
    due += period_of(rate_hz);
    std::this_thread::sleep_until(due);
  }
}

}  // namespace
}  // namespace v3d

int main(int /*argc*/, char** argv) {
  v3d::send(argv[1], std::atoll(argv[2]), std::atof(argv[3]), std::atof(argv[4]),
            static_cast<uint32_t>(std::atoll(argv[5])));
  return 0;
}
