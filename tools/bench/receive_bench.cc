// Benchmark of live frames over the loopback network: rate of received frames, and processor time
// of both ends. The bus, with and without a member list, is compared with liblcm and one MAC
// (HMAC-SHA-512-256) for each message.
// Needs a multicast route on `lo` (in its own namespace: unshare -Urn).
#include <lcm/lcm.h>
#include <sys/resource.h>

#include <atomic>
#include <memory>
#include <thread>

#include "daemon/bus/bus.h"
#include "rates.h"
#include "workload.h"

namespace v3d::bench {
namespace {

constexpr char kUrl[] = "udpm://239.255.76.67:7667?ttl=0&recv_buf_size=33554432";

double processor_seconds() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  const auto seconds = [](const timeval& t) {
    return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
  };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

/// Encoded raw XGA frames, one for each camera.
const std::vector<Bytes>& one_pulse() {
  static const std::vector<Bytes> pulse = [] {
    std::vector<Bytes> frames;
    for (int c = 0; c < kCameras; ++c) {
      FrameMessage message;
      message.frame.camera = rig()[c].name;
      message.frame.sensor_size = kSize;
      message.frame.roi = {0, 0, kSize.width, kSize.height};
      message.frame.image = raw_frames()[c];
      frames.push_back(encode(message));
    }
    return frames;
  }();
  return pulse;
}

/// Sender and receiver by the bus, with a studio key.
class BusPair {
 public:
  explicit BusPair(std::atomic<int64_t>& received) {
    const StudioKey key = StudioKey::make();
    sender_.authenticator().set_key(key);
    receiver_.authenticator().set_key(key);
    listening_.emplace(receiver_.subscribe("V3D_FRAME_.*", [&](const ReceivedMessage& in) {
      if (decode<FrameMessage>(in.bytes)) ++received;
    }));
  }
  void send(int camera, const Bytes& frame) {
    sender_.publish_authenticated(frame_channel(rig()[camera].name), frame);
  }

 private:
  Bus sender_{kUrl};
  Bus receiver_{kUrl};
  std::optional<Bus::Listening> listening_;
};

/// A studio of one capture and one reconstruction node.
Studio studio_of_members() {
  Studio studio;
  studio.nodes = {{"cap01"}, {"recon01"}};
  studio.trigger.node = "cap01";
  studio.cameras.resize(kCameras);
  for (size_t c = 0; c < studio.cameras.size(); ++c) {
    studio.cameras[c].name = rig()[c].name;
    studio.cameras[c].node = "cap01";
  }
  return studio;
}

/// Sender and receiver by the bus, with a member list: frames carry the MAC of a frame key.
class MemberPair {
 public:
  explicit MemberPair(std::atomic<int64_t>& received) {
    const StudioKey key = StudioKey::make();
    const SigningKey capture = SigningKey::make(), recon = SigningKey::make();
    const auto list = std::make_shared<const MemberList>(
        MemberList{.studio = "bench",
                   .serial = 1,
                   .members = {{"cap01", Role::kCapture, capture.public_key()},
                               {"recon01", Role::kReconstruction, recon.public_key()}}});
    enrol(sender_, key, capture, list);
    enrol(receiver_, key, recon, list);
    answers_.emplace(sender_.subscribe(kEventChannel, [](const ReceivedMessage&) {}));
    listening_.emplace(receiver_.subscribe("V3D_FRAME_.*", [&](const ReceivedMessage& in) {
      if (decode<FrameMessage>(in.bytes)) ++received;
    }));
    while (received == 0) {  // until the receiver has the frame key
      sender_.announce_frame_key("cap01");
      send(0, one_pulse()[0]);
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
    received = 0;
  }
  void send(int camera, const Bytes& frame) {
    sender_.publish_frame(0, frame_channel(rig()[camera].name), frame);
  }

 private:
  static void enrol(Bus& bus, const StudioKey& key, const SigningKey& signing_key,
                    const std::shared_ptr<const MemberList>& list) {
    bus.authenticator().set_key(key);
    bus.authenticator().members().require();
    bus.authenticator().members().set_signing_key(signing_key);
    bus.authenticator().members().set_members(list);
  }
  Bus sender_{kUrl, {}, ChannelList(studio_of_members())};
  Bus receiver_{kUrl, {}, ChannelList(studio_of_members())};
  std::optional<Bus::Listening> answers_, listening_;
};

/// Sender and receiver by liblcm. Each message ends with one MAC of all its bytes.
class LcmPair {
 public:
  explicit LcmPair(std::atomic<int64_t>& received) : received_(received) {
    constexpr int kQueue = 256;
    lcm_subscription_set_queue_capacity(
        lcm_subscribe(receiver_.get(), "V3D_FRAME_.*", on_message, this), kQueue);
    thread_ = std::thread([this] {
      while (!stopping_) lcm_handle_timeout(receiver_.get(), 50);
    });
  }
  ~LcmPair() {
    stopping_ = true;
    thread_.join();
  }
  void send(int camera, Bytes frame) {
    frame.resize(frame.size() + kCommandMacSize);
    key_.add_mac(frame);
    lcm_publish(sender_.get(), frame_channel(rig()[camera].name).c_str(), frame.data(),
                static_cast<unsigned>(frame.size()));
  }

 private:
  using Lcm = std::unique_ptr<lcm_t, decltype(&lcm_destroy)>;
  static void on_message(const lcm_recv_buf_t* in, const char*, void* user) {
    LcmPair& pair = *static_cast<LcmPair*>(user);
    const std::span bytes(static_cast<const uint8_t*>(in->data), in->data_size);
    if (!pair.key_.has_valid_mac(bytes)) return;
    if (decode<FrameMessage>(bytes.first(bytes.size() - kCommandMacSize))) ++pair.received_;
  }
  const StudioKey key_ = StudioKey::make();
  std::atomic<int64_t>& received_;
  const Lcm sender_{lcm_create(kUrl), lcm_destroy};
  const Lcm receiver_{lcm_create(kUrl), lcm_destroy};
  std::atomic<bool> stopping_ = false;
  std::thread thread_;
};

/// Sends pulse after pulse. The next one follows when the previous one has arrived or after 100 ms.
/// With `rate_hz` above 0, pulses are sent at this rate.
template <class Pair>
void receive(benchmark::State& state, double rate_hz) {
  std::atomic<int64_t> received = 0;
  Pair pair(received);
  const std::vector<Bytes>& frames = one_pulse();
  int64_t sent = 0;
  int64_t pulses = 0;
  const MonotonicInstant began = Monotonic::now();
  const double processor_before = processor_seconds();
  int64_t lost = 0;
  const double bytes = static_cast<double>(kSize.pixels()) * kCameras;
  measure(state, kCameras, bytes, [&] {
    if (rate_hz > 0) {
      std::this_thread::sleep_until(began + pulses * period_of(rate_hz));
    }
    ++pulses;
    for (int c = 0; c < kCameras; ++c) pair.send(c, frames[static_cast<size_t>(c)]);
    sent += kCameras;
    const MonotonicInstant until = Monotonic::now() + std::chrono::milliseconds(100);
    while (received + lost < sent && Monotonic::now() < until) {
      std::this_thread::sleep_for(std::chrono::microseconds(100));
    }
    lost = sent - received;
  });
  state.counters["lost"] = static_cast<double>(lost);
  state.counters["cpu_ns_per_byte"] = 1e9 * (processor_seconds() - processor_before) /
                                      (bytes * static_cast<double>(state.iterations()));
}

constexpr double kUnpaced = 0;
constexpr double kLive = 25;
void by_bus(benchmark::State& state) { receive<BusPair>(state, kUnpaced); }
void by_liblcm(benchmark::State& state) { receive<LcmPair>(state, kUnpaced); }
void by_bus_live(benchmark::State& state) { receive<BusPair>(state, kLive); }
void by_members_live(benchmark::State& state) { receive<MemberPair>(state, kLive); }
void by_liblcm_live(benchmark::State& state) { receive<LcmPair>(state, kLive); }

BENCHMARK(by_bus)->Name("receive/15xXGA");
BENCHMARK(by_liblcm)->Name("receive/15xXGA/liblcm");
BENCHMARK(by_bus_live)->Name("receive/15xXGA/25Hz");
BENCHMARK(by_members_live)->Name("receive/15xXGA/25Hz/members");
BENCHMARK(by_liblcm_live)->Name("receive/15xXGA/25Hz/liblcm");

}  // namespace
}  // namespace v3d::bench
