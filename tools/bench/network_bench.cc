// Benchmark of authentication: verification of commands, health and meshes, signing of meshes, and
// checksums of recorded frames.
#include <lcm/lcm.h>
#include <sys/resource.h>

#include <atomic>
#include <memory>
#include <thread>

#include "base/core/bytes.h"
#include "daemon/bus/bus.h"
#include "daemon/bus/credentials.h"
#include "daemon/bus/message_authenticator.h"
#include "rates.h"
#include "wire/codec.h"
#include "wire/messages.h"
#include "workload.h"

namespace v3d::bench {
namespace {

wire::CommandMessage stop_command() {
  wire::CommandMessage command;
  command.sender = "ada@desk/1";
  command.verb = wire::CommandVerb::kStop;
  command.take = "kendo-07";
  for (int i = 1; i <= 15; ++i) {
    command.to.push_back("cap" + std::to_string(i));
    command.nonces.push_back(i);
  }
  return command;
}

/// A list of 30 members; the operator is the last.
std::shared_ptr<const wire::MemberList> members_with(const wire::SigningKey& operator_key) {
  auto list = std::make_shared<wire::MemberList>();
  for (int i = 1; i < 30; ++i) {
    list->members.push_back(
        {"cap" + std::to_string(i), wire::Role::kCapture, wire::SigningKey::make().public_key()});
  }
  list->members.push_back({"ada", wire::Role::kOperator, operator_key.public_key()});
  return list;
}

/// Verifies one command repeatedly.
void verify(benchmark::State& state, const bus::Credentials& credentials) {
  const MonotonicInstant now = Monotonic::now();
  const wire::Bytes command = credentials.authenticate(encode(stop_command()), now);
  measure(state, 1, 0, [&] {
    if (credentials.open_command(command, now).result != bus::OpenedCommand::Result::kAccepted) {
      state.SkipWithError("the command was rejected");
    }
  });
}

void verify_mac(benchmark::State& state) {
  bus::Credentials credentials;
  credentials.set_studio_key(wire::StudioKey::make(), Monotonic::now());
  verify(state, credentials);
}

void verify_signature(benchmark::State& state) {
  const wire::SigningKey key = wire::SigningKey::make();
  bus::Credentials credentials;
  credentials.set_studio_key(wire::StudioKey::make(), Monotonic::now());
  credentials.require_members();
  credentials.set_members(members_with(key));
  credentials.set_signing_key(key);
  verify(state, credentials);
}

/// Health message of a capture node, with 80 values.
wire::Bytes health_of_a_node() {
  wire::HealthMessage health;
  health.node = "cap01";
  for (int i = 0; i < 80; ++i) health.values["cam01.frames_of_kind_" + std::to_string(i)] = i;
  return encode(health);
}

wire::Bytes mesh_of_the_performer() {
  wire::MeshMessage mesh;
  mesh.take = "kendo-07";
  mesh.compact = compact_10mm();
  return encode(mesh);
}

/// Verifies one message repeatedly. Its sender is the last of 30 members.
void verify_on_bus(benchmark::State& state, const std::string& channel,
                   const wire::Bytes& message) {
  const wire::SigningKey key = wire::SigningKey::make();
  auto list = std::make_shared<wire::MemberList>(*members_with(wire::SigningKey::make()));
  list->members.back() = {"recon01", wire::Role::kReconstruction, key.public_key()};
  bus::MemberSignatures signatures;
  signatures.set_members(list);
  const wire::MessageOrigin origin{.channel = channel, .session = 1, .sequence = 2, .sent = {}};
  const wire::Bytes bytes = sign_on_bus(message, origin, key);
  measure(state, 1, static_cast<double>(bytes.size()), [&] {
    const auto verified = signatures.verify(bytes, origin, *bus::kind_of(channel), "recon01");
    if (!verified.problem.empty()) state.SkipWithError("the message was rejected");
  });
}

void verify_health(benchmark::State& state) {
  verify_on_bus(state, wire::health_channel("recon01"), health_of_a_node());
}
void verify_mesh(benchmark::State& state) {
  verify_on_bus(state, wire::kMeshChannel, mesh_of_the_performer());
}

/// Signs one mesh, as its sender does.
void sign_mesh(benchmark::State& state) {
  const wire::SigningKey key = wire::SigningKey::make();
  const wire::Bytes mesh = mesh_of_the_performer();
  const wire::MessageOrigin origin{
      .channel = wire::kMeshChannel, .session = 1, .sequence = 2, .sent = {}};
  measure(state, 1, static_cast<double>(mesh.size()),
          [&] { benchmark::DoNotOptimize(sign_on_bus(mesh, origin, key)); });
}

void checksum_of_a_frame(benchmark::State& state) {
  const std::vector<uint8_t> frame(1024 * 768, 77);
  measure(state, 1, static_cast<double>(frame.size()),
          [&] { benchmark::DoNotOptimize(checksum({frame})); });
}

BENCHMARK(verify_mac)->Name("verify/command/mac");
BENCHMARK(verify_signature)->Name("verify/command/signature");
BENCHMARK(verify_health)->Name("verify/health/signature");
BENCHMARK(verify_mesh)->Name("verify/mesh/signature");
BENCHMARK(sign_mesh)->Name("sign/mesh/signature");
BENCHMARK(checksum_of_a_frame)->Name("checksum/XGA");

}  // namespace

// Benchmark of live frames over the loopback network: rate of received frames, and processor time
// of both ends. The bus, with and without a member list, is compared with liblcm and one MAC
// (HMAC-SHA-512-256) for each message.
// Needs a multicast route on `lo` (in its own namespace: unshare -Urn).

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
const std::vector<wire::Bytes>& one_pulse() {
  static const std::vector<wire::Bytes> pulse = [] {
    std::vector<wire::Bytes> frames;
    for (int c = 0; c < kCameras; ++c) {
      wire::FrameMessage message;
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
    const wire::StudioKey key = wire::StudioKey::make();
    sender_.authenticator().set_key(key);
    receiver_.authenticator().set_key(key);
    registration_.emplace(receiver_.subscribe("V3D_FRAME_.*", [&](const bus::ReceivedMessage& in) {
      if (wire::decode<wire::FrameMessage>(in.bytes)) ++received;
    }));
  }
  void send(int camera, const wire::Bytes& frame) {
    sender_.publish_authenticated(wire::frame_channel(rig()[camera].name), frame);
  }

 private:
  bus::Bus sender_{kUrl};
  bus::Bus receiver_{kUrl};
  std::optional<bus::Bus::HandlerRegistration> registration_;
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
    const wire::StudioKey key = wire::StudioKey::make();
    const wire::SigningKey capture = wire::SigningKey::make(), recon = wire::SigningKey::make();
    const auto list = std::make_shared<const wire::MemberList>(wire::MemberList{
        .studio = "bench",
        .serial = 1,
        .members = {{"cap01", wire::Role::kCapture, capture.public_key()},
                    {"recon01", wire::Role::kReconstruction, recon.public_key()}}});
    enrol(sender_, key, capture, list);
    enrol(receiver_, key, recon, list);
    responder_.emplace(sender_.subscribe(wire::kEventChannel, [](const bus::ReceivedMessage&) {}));
    registration_.emplace(receiver_.subscribe("V3D_FRAME_.*", [&](const bus::ReceivedMessage& in) {
      if (wire::decode<wire::FrameMessage>(in.bytes)) ++received;
    }));
    while (received == 0) {  // until the receiver has the frame key
      sender_.announce_frame_key("cap01");
      send(0, one_pulse()[0]);
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
    received = 0;
  }
  void send(int camera, const wire::Bytes& frame) {
    sender_.publish_frame(0, wire::frame_channel(rig()[camera].name), frame);
  }

 private:
  static void enrol(bus::Bus& bus, const wire::StudioKey& key, const wire::SigningKey& signing_key,
                    const std::shared_ptr<const wire::MemberList>& list) {
    bus.authenticator().set_key(key);
    bus.authenticator().members().require();
    bus.authenticator().members().set_signing_key(signing_key);
    bus.authenticator().members().set_members(list);
  }
  bus::Bus sender_{kUrl, {}, bus::ChannelList(studio_of_members())};
  bus::Bus receiver_{kUrl, {}, bus::ChannelList(studio_of_members())};
  std::optional<bus::Bus::HandlerRegistration> responder_, registration_;
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
  void send(int camera, wire::Bytes frame) {
    frame.resize(frame.size() + wire::kCommandMacSize);
    key_.add_mac(frame);
    lcm_publish(sender_.get(), wire::frame_channel(rig()[camera].name).c_str(), frame.data(),
                static_cast<unsigned>(frame.size()));
  }

 private:
  using Lcm = std::unique_ptr<lcm_t, decltype(&lcm_destroy)>;
  static void on_message(const lcm_recv_buf_t* in, const char*, void* user) {
    LcmPair& pair = *static_cast<LcmPair*>(user);
    const std::span bytes(static_cast<const uint8_t*>(in->data), in->data_size);
    if (!pair.key_.has_valid_mac(bytes)) return;
    if (wire::decode<wire::FrameMessage>(bytes.first(bytes.size() - wire::kCommandMacSize)))
      ++pair.received_;
  }
  const wire::StudioKey key_ = wire::StudioKey::make();
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
  const std::vector<wire::Bytes>& frames = one_pulse();
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
  // With a smaller receive buffer than the studio has (systemd/v3d.sysctl.conf), bursts are lost.
  state.SetLabel(bus::receive_buffer_problem(kUrl));
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
