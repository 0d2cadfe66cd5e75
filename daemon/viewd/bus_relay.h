// Relay of verified bus messages from a second process. That process has the studio key, which
// verifies messages and signs commands. The process that parses browser requests has no key.
#pragma once

#include <sys/types.h>

#include <deque>
#include <optional>
#include <stdexcept>
#include <string>
#include <variant>

#include "base/config/studio_file.h"
#include "base/core/time.h"
#include "base/io/unique_fd.h"
#include "wire/messages.h"

namespace v3d::viewd {

/// Why relayed messages are not verified; empty: they are.
struct NotVerified {
  std::string why;
};
using RelayedMessage = std::variant<NotVerified, wire::MeshMessage, wire::HealthMessage,
                                    wire::EventMessage, wire::PreviewMessage>;

/// The format in the pipe: u32 (little-endian) number of bytes that follow, u8 kind, message.
std::string encode_record(const RelayedMessage& message);

/// Decodes records from a stream of bytes, which may be split anywhere.
class RelayReader {
 public:
  static constexpr size_t kMaxBytes = 64 << 20;  ///< of a record

  /// Skips records that do not decode. Throws std::runtime_error for an invalid length.
  void read(std::string_view bytes);
  std::optional<RelayedMessage> next();

 private:
  std::string buffer_;  ///< incomplete record
  std::deque<RelayedMessage> messages_;
};

/// The main loop of the second process: writes all received messages to the pipe `to`, first
/// NotVerified, until the other end is closed.
void relay_bus(const Studio& studio, int to);

/// The second process has ended, so that no more messages arrive.
struct BusRelayEnded : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// Starts this program as second process and reads its messages. One thread.
class BusRelay {
 public:
  /// `flag`: the option that makes this program call relay_bus() on standard output.
  BusRelay(const Studio& studio, const std::string& flag);
  ~BusRelay();
  BusRelay(const BusRelay&) = delete;
  BusRelay& operator=(const BusRelay&) = delete;

  /// Waits for messages, until `deadline`, and reads them. Throws BusRelayEnded.
  void wait(MonotonicInstant deadline);
  std::optional<RelayedMessage> next() { return reader_.next(); }

 private:
  pid_t child_ = -1;
  io::UniqueFd pipe_;
  RelayReader reader_;
};

}  // namespace v3d::viewd
