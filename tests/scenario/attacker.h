// A thread that sends all known attacks to a studio, in turn and at a stated rate.
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <cstdlib>
#include <span>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "base/core/time.h"
#include "base/io/unique_fd.h"
#include "support/loopback_connection.h"
#include "support/raw_datagrams.h"
#include "wire/codec.h"
#include "wire/datagram_mac.h"
#include "wire/messages.h"

namespace v3d::test {

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
inline constexpr std::array<const char*, 11> kAttackNames = {"channel without a NUL",
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

/// Ports of TCP at 127.0.0.1 that an Attacker opens connections to.
struct AttackedPorts {
  int viewd = 0;
  int metrics = 0;  ///< of a daemon; 0: none
};

/// Sends all attacks in turn on a thread of its own until it is destroyed: 2,000 datagrams a
/// second, or V3D_ATTACK_RATE.
class Attacker {
 public:
  /// The first attacks are as many datagrams of 64 KB. A process has buffers for 512 datagrams
  /// (DatagramRing), whose pages the kernel provides at their first use: they have them afterwards.
  static constexpr int64_t kLongOnes = 2'000;

  /// `url`: an LCM URL (udpm).
  Attacker(const std::string& url, const AttackedPorts& ports) : network_(url), ports_(ports) {
    network_.ignore_own();
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
  static constexpr Duration kPause = std::chrono::milliseconds(10);
  /// Unfinished requests to v3d-viewd and to the metrics of a daemon. The oldest one of each is
  /// replaced in each round.
  static constexpr size_t kHalfOpen = 64, kHalfOpenMetrics = 200;
  /// Datagrams in each pause.
  static int burst() {
    const char* const rate = std::getenv("V3D_ATTACK_RATE");
    return (rate != nullptr ? std::atoi(rate) : 2'000) / 100;
  }

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

  /// Records datagrams of the studio, which have a MAC.
  void record() {
    for (int i = 0; i < 64; ++i) {
      RawDatagram datagram = network_.receive(Duration::zero());
      if (datagram.empty()) return;
      if (datagram.size() <= wire::kMacTrailerSize) continue;
      if (!wire::read_trailer(std::span(datagram).last<wire::kMacTrailerSize>())) continue;
      recorded_[recordings_++ % recorded_.size()] = std::move(datagram);
    }
  }

  void attack() {
    const auto kind = total_ < kLongOnes ? Attack::kForgedFragment
                                         : static_cast<Attack>(total_ % kAttackNames.size());
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
    replace_oldest(half_open_, kHalfOpen, ports_.viewd, request(connections_));
    if (ports_.metrics == 0) return;
    replace_oldest(half_open_metrics_, kHalfOpenMetrics, ports_.metrics, "GET /metrics HTTP/1.0");
  }
  void replace_oldest(std::vector<io::UniqueFd>& open, size_t most, int port,
                      const std::string& begin) {
    if (open.size() < most) open.emplace_back();
    auto& oldest = open[static_cast<size_t>(connections_++) % open.size()];
    oldest = connect_to_loopback(port, begin);
  }
  /// A request that never ends, one with two hosts, and an order with a wrong token.
  static std::string request(int64_t number) {
    if (number % 3 == 0) return "GET / HTTP/1.1\r\nHo";
    if (number % 3 == 1) return "GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nHost: other\r\n\r\n";
    return "POST /api/order HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Type: application/json\r\n"
           "X-V3D-Operator: wrong-0123456789\r\nContent-Length: 14\r\n\r\n{\"do\": \"stop\"}";
  }

  const RawSocket network_;
  const AttackedPorts ports_;
  const int burst_ = burst();
  const wire::StudioKey other_key_ = wire::StudioKey::make();
  std::array<RawDatagram, 256> recorded_;
  size_t recordings_ = 0;
  std::vector<io::UniqueFd> half_open_, half_open_metrics_;
  std::array<std::atomic<int64_t>, kAttackNames.size()> sent_{};
  std::atomic<int64_t> total_ = 0, connections_ = 0;
  std::atomic<bool> stopping_ = false;
  std::thread thread_;
};

}  // namespace v3d::test
