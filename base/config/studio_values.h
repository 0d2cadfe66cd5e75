// Values of the studio file that lower layers use.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "base/core/time.h"

namespace v3d {

// The colour of a studio whose background is painted for chroma keying.

enum class ChromaKey : uint8_t { kNone, kGreen, kBlue };

/// "none", "green" or "blue", as in studio files and background models.
std::string_view name(ChromaKey key);
std::optional<ChromaKey> chroma_key_from_name(std::string_view name);

// Parses LCM URLs: multicast group and socket options.

/// Multicast address and port of an LCM network.
struct LcmGroup {
  std::string address = "239.255.76.67";  ///< LCM's default for a URL without an address
  uint16_t port = 7667;
  friend bool operator==(const LcmGroup&, const LcmGroup&) = default;
};

/// Parses the group of a URL like "udpm://239.255.76.67:7667?ttl=1". Empty when it is not a
/// multicast URL of LCM, or its address is not an IPv4 multicast address.
std::optional<LcmGroup> lcm_group(const std::string& url);

/// The options after the '?' of an LCM URL. Other options are ignored, as in liblcm.
struct LcmOptions {
  int ttl = 0;            ///< routers that a datagram may pass; 0: it stays on this host
  int recv_buf_size = 0;  ///< size of the socket's receive buffer, bytes; 0: the kernel's default
  friend bool operator==(const LcmOptions&, const LcmOptions&) = default;
};

/// Parses the options of a URL like "udpm://239.255.76.67:7667?ttl=1&recv_buf_size=16777216". Empty
/// when `ttl` or `recv_buf_size` is not a number, `ttl` exceeds 255 or `recv_buf_size` exceeds
/// 2^30.
std::optional<LcmOptions> lcm_options(const std::string& url);

// The range of pulse rates, for studio files, pulse trains and commands of operators.

inline constexpr double kMinPulseRateHz = 0.01;
inline constexpr double kMaxPulseRateHz = 1000;

/// True within the range; false for NaN.
constexpr bool is_pulse_rate(double hz) { return hz >= kMinPulseRateHz && hz <= kMaxPulseRateHz; }

/// Error message for a rate outside the range: "a pulse rate of 5000 Hz is not possible; expected
/// 0.01 to 1000 Hz".
std::string pulse_rate_error(double hz);

// Messages of the simulated trigger cable, a Unix socket (SOCK_SEQPACKET) on which the simulated
// studio listens.
// The generator is one client, the sense line another. A packet is one rising edge (TriggerEdge),
// in either direction: the studio exposes its cameras at every edge it receives, and sends the edge
// back to all clients, which a sense line reads.
// As on a real cable, an edge carries no pulse number.

struct TriggerEdge {
  int64_t edge_monotonic_ns = 0;  ///< CLOCK_MONOTONIC; both ends are on one machine
};

// Which pulse numbers are plausible: rejects wrong numbers in messages.

/// Compares the number of a pulse with the newest number before and with the time since then.
///
/// One wrong number, accepted as the newest, would make all right numbers after it late. A pulse
/// train has at most kMaxPulseRateHz, so the number of a pulse is at most `max_jump` plus
/// kMaxPulseRateHz times the time since the newest one ahead of it. The part with the time permits
/// messages to be absent for any time; `max_jump` permits them to be delayed.
/// `now` must never decrease. One thread.
class PlausiblePulses {
 public:
  static constexpr int64_t kMaxJump = 15'000;  ///< 15 s at kMaxPulseRateHz

  /// Until add(), every number from 0 on is plausible.
  explicit PlausiblePulses(int64_t max_jump = kMaxJump) : max_jump_(max_jump) {}

  bool contains(int64_t pulse, MonotonicInstant now) const {
    if (pulse < 0) return false;
    if (!newest_ || pulse <= *newest_) return true;
    const double since = to_seconds(now - newest_at_) * kMaxPulseRateHz;
    return pulse - *newest_ <= max_jump_ + static_cast<int64_t>(since);
  }
  /// `pulse`, 0 or more, was accepted. Numbers below the newest one change nothing.
  void add(int64_t pulse, MonotonicInstant now) {
    if (newest_ && pulse <= *newest_) return;
    newest_ = pulse;
    newest_at_ = now;
  }

 private:
  int64_t max_jump_;
  std::optional<int64_t> newest_;
  MonotonicInstant newest_at_;
};

}  // namespace v3d
