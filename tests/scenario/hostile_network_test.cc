// Scenario test of all known attacks, in turn and at a stated rate, during a take: the take is
// complete, stop is executed within 2 s, and memory growth and processor time are bounded.
// V3D_ATTACK_RATE=50000 sends that many datagrams a second instead of 2,000. docs/security.md
// publishes the printed figures.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <array>
#include <atomic>
#include <cstdio>
#include <cstdlib>
#include <thread>

#include "daemon/bus/bus.h"
#include "support/process_meter.h"
#include "support/raw_datagrams.h"
#include "take/ledger/verify.h"
#include "viewed_studio.h"
#include "wire/datagram_mac.h"
#include "wire/messages.h"

namespace v3d {
namespace {

using namespace std::chrono_literals;
using test::becomes_true;
using test::fragment_header;
using test::put_text;
using test::RawDatagram;
using test::RawSocket;
using test::short_datagram;
using test::ViewedStudio;
using test::within;

constexpr int kPulses = 100;
constexpr Duration kPause = 10ms;
/// Datagrams in each pause.
int burst() {
  const char* const rate = std::getenv("V3D_ATTACK_RATE");
  return (rate != nullptr ? std::atoi(rate) : 2'000) / 100;
}
/// Connections to v3d-viewd with an unfinished request. The oldest one is replaced in each round.
constexpr size_t kHalfOpen = 64;
/// Upper bound of the growth of one process, kB.
constexpr double kMaxGrowthKb = 16 * 1024;
/// Upper bound of the time until a stop is executed, s.
constexpr double kMaxStopS = 2;
/// Upper bound of the processor time of the three daemons for one attack datagram, microseconds.
/// Several times what an idle machine needs.
constexpr double kMaxProcessorUs = 250;

enum class Attack : uint8_t {
  kNoNul,
  kOffsetThatWraps,
  kClaimOf256MB,
  kClaimOf1MB,
  kInventedChannel,
  kRepeated,
  kChangedByte,
  kShortened,
  kForgedCommand,
  kLongForgedCommand,
  kForgedFragment,
};
constexpr std::array<const char*, 11> kAttackNames = {"channel without a NUL",
                                                      "fragment whose offset wraps",
                                                      "claim of 256 MB",
                                                      "command that claims 1 MB",
                                                      "invented channel",
                                                      "recorded datagram, repeated",
                                                      "recorded datagram, a byte changed",
                                                      "recorded, shortened MAC",
                                                      "command of another key",
                                                      "command of another key, 16 KiB",
                                                      "fragment of 64 KB without a channel"};

/// Sends all attacks in turn on a thread of its own until it is destroyed.
class Attacker {
 public:
  Attacker(const std::string& url, int port) : network_(url), port_(port) {
    thread_ = std::thread([this] { run(); });
  }
  ~Attacker() { stop(); }
  Attacker(const Attacker&) = delete;
  Attacker& operator=(const Attacker&) = delete;

  void stop() {
    stopping_ = true;
    if (thread_.joinable()) thread_.join();
  }
  int64_t sent(Attack attack) const { return sent_[static_cast<size_t>(attack)]; }
  int64_t sent() const { return total_; }
  int64_t connections() const { return connections_; }

 private:
  void run() {
    MonotonicInstant next = Monotonic::now();
    while (!stopping_) {
      record();
      for (int i = 0; i < burst_; ++i) attack();
      keep_half_open();
      // After a delay, the attacker does not make up for the datagrams that it could not send.
      next = std::max(next + kPause, Monotonic::now() + kPause / 2);
      std::this_thread::sleep_until(next);
    }
  }

  /// Records datagrams of the studio: those with a MAC that are newer than all recorded ones. This
  /// skips the attacker's own datagrams, which the group returns.
  void record() {
    for (int i = 0; i < 64; ++i) {
      RawDatagram datagram = network_.receive(Duration::zero());
      if (datagram.empty()) return;
      if (datagram.size() <= wire::kMacTrailerSize) continue;
      const auto trailer = wire::read_trailer(std::span(datagram).last<wire::kMacTrailerSize>());
      if (!trailer || trailer->sent <= newest_) continue;
      newest_ = trailer->sent;
      recorded_[recordings_++ % recorded_.size()] = std::move(datagram);
    }
  }

  void attack() {
    const auto kind = static_cast<Attack>(total_ % kAttackNames.size());
    const RawDatagram datagram = datagram_of(kind);
    ++total_;
    if (datagram.empty()) return;  // nothing is recorded yet
    network_.send(datagram);
    ++sent_[static_cast<size_t>(kind)];
  }

  RawDatagram datagram_of(Attack kind) {
    const auto number = static_cast<uint32_t>(total_);
    switch (kind) {
      case Attack::kNoNul:
        return short_datagram(number, wire::kCommandChannel);
      case Attack::kOffsetThatWraps: {
        RawDatagram bytes = fragment_header({.sequence = number,
                                             .message_size = 8192,
                                             .offset = 0U - 0x1000,
                                             .number = 1,
                                             .count = 3});
        bytes.resize(bytes.size() + 0x1000, 'y');
        return bytes;
      }
      case Attack::kClaimOf256MB:
        return claim_of(256U << 20, number);
      case Attack::kClaimOf1MB:
        return claim_of(1U << 20, number);
      case Attack::kInventedChannel:
        return short_datagram(number,
                              wire::frame_channel("invented" + std::to_string(number)) + '\0');
      case Attack::kForgedCommand:
        return forged_command(number);
      case Attack::kLongForgedCommand: {
        RawDatagram bytes = forged_command(number);
        bytes.resize(16'000, 'x');
        const auto trailer = wire::MacTrailer{.session = number, .sent = Realtime::now()}.bytes();
        bytes.insert(bytes.end(), trailer.begin(), trailer.end());
        return bytes;
      }
      case Attack::kForgedFragment:
        return forged_fragment(number);
      case Attack::kRepeated:
      case Attack::kChangedByte:
      case Attack::kShortened:
        return changed_recording(kind);
    }
    return {};
  }

  /// First fragment of a command with one byte of data, whose header claims `size` bytes.
  static RawDatagram claim_of(uint32_t size, uint32_t number) {
    const auto count = static_cast<uint16_t>(size / 60'000 + 1);
    RawDatagram bytes = fragment_header({.sequence = number, .message_size = size, .count = count});
    put_text(bytes, std::string(wire::kCommandChannel) + '\0' + "x");
    return bytes;
  }

  RawDatagram forged_command(uint32_t number) const {
    wire::CommandMessage command;
    command.sender = "operator@desk/1/2";
    command.verb = wire::CommandVerb::kStop;
    command.take = "kendo-07";
    command.counter = number;
    RawDatagram bytes = short_datagram(number, std::string(wire::kCommandChannel) + '\0');
    const wire::Bytes authenticated = encode_with_mac(command, other_key_);
    bytes.insert(bytes.end(), authenticated.begin(), authenticated.end());
    return bytes;
  }

  /// The second of two fragments, with a trailer whose tag is wrong.
  static RawDatagram forged_fragment(uint32_t number) {
    constexpr uint32_t kHalf = 64'000;
    RawDatagram bytes = fragment_header({.sequence = number,
                                         .message_size = 2 * kHalf + wire::kMacTrailerSize,
                                         .offset = kHalf,
                                         .number = 1});
    bytes.resize(bytes.size() + kHalf, 'x');
    const auto trailer = wire::MacTrailer{.session = number, .sent = Realtime::now()}.bytes();
    bytes.insert(bytes.end(), trailer.begin(), trailer.end());
    return bytes;
  }

  RawDatagram changed_recording(Attack kind) {
    const size_t kept = std::min(recordings_, recorded_.size());
    if (kept == 0) return {};
    RawDatagram bytes = recorded_[static_cast<size_t>(total_) % kept];
    if (kind == Attack::kChangedByte) bytes[bytes.size() / 2] ^= 1;
    if (kind == Attack::kShortened) bytes.resize(bytes.size() - std::min<size_t>(5, bytes.size()));
    return bytes;
  }

  void keep_half_open() {
    if (half_open_.size() < kHalfOpen) half_open_.emplace_back();
    auto& oldest = half_open_[static_cast<size_t>(connections_++) % half_open_.size()];
    oldest = std::make_unique<HalfOpen>(port_, request(connections_));
  }
  /// A request that never ends, one with two hosts, and an order with a wrong token.
  static std::string request(int64_t number) {
    if (number % 3 == 0) return "GET / HTTP/1.1\r\nHo";
    if (number % 3 == 1) return "GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nHost: other\r\n\r\n";
    return "POST /api/order HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Type: application/json\r\n"
           "X-V3D-Operator: wrong-0123456789\r\nContent-Length: 14\r\n\r\n{\"do\": \"stop\"}";
  }

  /// A connection that sends `begin` and nothing more.
  class HalfOpen {
   public:
    HalfOpen(int port, const std::string& begin)
        : fd_(socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
      sockaddr_in address{};
      address.sin_family = AF_INET;
      address.sin_port = htons(static_cast<uint16_t>(port));
      address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
      if (connect(fd_, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) return;
      send(fd_, begin.data(), begin.size(), MSG_NOSIGNAL);
    }
    ~HalfOpen() { close(fd_); }
    HalfOpen(const HalfOpen&) = delete;
    HalfOpen& operator=(const HalfOpen&) = delete;

   private:
    const int fd_;
  };

  const RawSocket network_;
  const int port_;
  const int burst_ = burst();
  const wire::StudioKey other_key_ = wire::StudioKey::make();
  std::array<RawDatagram, 256> recorded_;
  size_t recordings_ = 0;
  RealtimeInstant newest_{};
  std::vector<std::unique_ptr<HalfOpen>> half_open_;
  std::array<std::atomic<int64_t>, kAttackNames.size()> sent_{};
  std::atomic<int64_t> total_ = 0, connections_ = 0;
  std::atomic<bool> stopping_ = false;
  std::thread thread_;
};

class HostileNetwork : public ViewedStudio {
 protected:
  explicit HostileNetwork(bool has_members = false) : ViewedStudio("", has_members) {
    // A take whose file is a FIFO.
    std::filesystem::create_directories(folder_ / "trap");
    mkfifo((folder_ / "trap/take.toml").c_str(), 0666);
  }

  /// Resources that the daemons used while a take was recorded.
  struct Cost {
    double seconds = 0;
    double processor_s = 0;
    double growth_kb = 0;  ///< growth of the process that grew most
    int64_t attacks = 0;
  };

  std::array<pid_t, 3> daemons() const { return {captured_->pid(), recond_->pid(), viewd_->pid()}; }

  /// Records a take of kPulses pulses and returns its cost. Fails the test when it is incomplete.
  Cost record(const std::string& name, const Attacker* attacker = nullptr) {
    take_name_ = name;
    arm_and_start(0);
    std::array<test::ProcessSample, 3> before;
    for (size_t i = 0; i < 3; ++i) before[i] = test::sample(daemons()[i]);
    const int64_t sent = attacker != nullptr ? attacker->sent() : 0;
    const MonotonicInstant start = Monotonic::now();
    EXPECT_TRUE(reaches("cap01", "frames_written", 4 * kPulses)) << log();
    Cost cost{.seconds = to_seconds(Monotonic::now() - start)};
    if (attacker != nullptr) cost.attacks = attacker->sent() - sent;
    for (size_t i = 0; i < 3; ++i) {
      const test::ProcessSample now = test::sample(daemons()[i]);
      cost.processor_s += now.processor_s - before[i].processor_s;
      cost.growth_kb = std::max(cost.growth_kb, now.resident_kb - before[i].resident_kb);
    }
    const MonotonicInstant stop_sent = Monotonic::now();
    const control::Answer stopped = command(wire::CommandVerb::kStop);
    const double stop_s = to_seconds(Monotonic::now() - stop_sent);
    EXPECT_TRUE(stopped.done()) << text_of(stopped) << log();
    EXPECT_LT(stop_s, kMaxStopS);
    std::printf("%s: stop was executed in %.2f s\n", name.c_str(), stop_s);
    const take::Verification found = verify_take(take());
    EXPECT_TRUE(found.whole()) << found.ledger.verdict();
    return cost;
  }
  /// Records a take without and one with attacks.
  void expect_no_harm();
  void expect_rejected(const std::string& cause) {
    EXPECT_TRUE(reaches("cap01", cause, 50)) << cause;
    std::printf("  %-20s %6.0f rejected by cap01\n", cause.c_str(), value("cap01", cause));
  }
};

void HostileNetwork::expect_no_harm() {
  const Cost quiet = record("kendo-07");
  Attacker attacker(studio_.network.lcm_url, port_);
  ASSERT_TRUE(becomes_true([&] { return attacker.sent() >= 2'000; }, within(60)));
  const Cost attacked = record("kendo-08", &attacker);
  for (const char* cause : {"datagrams_malformed", "datagrams_foreign", "datagrams_oversized",
                            "messages_forged", "messages_replayed"}) {
    expect_rejected(cause);
  }
  attacker.stop();

  for (size_t i = 0; i < kAttackNames.size(); ++i) {
    std::printf("  %-34s %6lld sent\n", kAttackNames[i],
                static_cast<long long>(attacker.sent(static_cast<Attack>(i))));
  }
  const auto sent = static_cast<double>(attacked.attacks);
  const double of_a_core = attacked.processor_s / attacked.seconds;
  const double more = of_a_core - quiet.processor_s / quiet.seconds;
  const double us_each = 1e6 * more * attacked.seconds / sent;
  std::printf(
      "  %.0f datagrams a second, %lld half-open connections; three daemons used %.2f of a "
      "core (%.2f without attack), %.0f us a datagram; the largest grew by %.0f KiB\n",
      sent / attacked.seconds, static_cast<long long>(attacker.connections()), of_a_core,
      quiet.processor_s / quiet.seconds, us_each, attacked.growth_kb);
  for (test::ChildProcess* daemon : {&*captured_, &*recond_, &*viewd_})
    EXPECT_TRUE(daemon->runs()) << log();
  EXPECT_LT(attacked.growth_kb, kMaxGrowthKb);
  EXPECT_LT(us_each, kMaxProcessorUs);
  EXPECT_TRUE(get("/index.html")->receives("200 OK")) << "v3d-viewd still serves browsers";
  EXPECT_TRUE(get("/api/takes")->receives("kendo-08")) << "beside a FIFO";
}

TEST_F(HostileNetwork, harms_no_take_and_causes_bounded_memory_growth) { expect_no_harm(); }

class HostileNetworkOfMembers : public HostileNetwork {
 protected:
  HostileNetworkOfMembers() : HostileNetwork(true) {}
};

TEST_F(HostileNetworkOfMembers, harms_no_take_and_causes_bounded_memory_growth) {
  expect_no_harm();
}

}  // namespace
}  // namespace v3d
