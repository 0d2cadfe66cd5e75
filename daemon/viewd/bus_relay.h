// What is heard on the studio's network, from a process of its own: it has the studio key, which
// seals are checked with and commands are made with; the one that reads what browsers send has not.
#pragma once

#include <sys/types.h>

#include <deque>
#include <optional>
#include <stdexcept>
#include <string>
#include <variant>

#include "base/studio_file.h"
#include "base/time.h"
#include "wire/messages.h"

namespace v3d {

/// Why what is heard may be anybody's; empty: only what is sealed is told.
struct NotVerified {
  std::string why;
};
using Heard = std::variant<NotVerified, MeshMessage, HealthMessage, EventMessage, PreviewMessage>;

/// As it goes through the pipe: u32 (little-endian) length of what follows, u8 kind, the message.
std::string heard_record(const Heard& heard);

/// Makes messages of bytes, however they are cut.
class RelayReader {
 public:
  static constexpr size_t kMaxBytes = 64 << 20;  ///< of a record

  /// Passes over what does not decode. Throws std::runtime_error where no record begins.
  void read(std::string_view bytes);
  std::optional<Heard> next();

 private:
  std::string left_;
  std::deque<Heard> heard_;
};

/// Tells what is heard, first whether it is verified, until `to` is closed at its other end. The
/// work of the process.
void tell_what_is_heard(const Studio& studio, int to);

/// The process that hears has ended: nothing can be shown any more.
struct BusRelayEnded : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// The other end. Starts this program anew for it. One thread.
class BusRelay {
 public:
  /// `flag`: what makes this program tell_what_is_heard() on its standard output.
  BusRelay(const Studio& studio, const std::string& flag);
  ~BusRelay();
  BusRelay(const BusRelay&) = delete;
  BusRelay& operator=(const BusRelay&) = delete;

  /// Waits until there is something, or `deadline`. Throws BusRelayEnded.
  void wait(MonotonicInstant deadline);
  std::optional<Heard> next() { return reader_.next(); }

 private:
  pid_t child_ = -1;
  int from_ = -1;
  RelayReader reader_;
};

}  // namespace v3d
