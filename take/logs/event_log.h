// EventLogReader: random access to the events of an LCM event log that may be damaged.
//
// LCM's own reader allocates whatever a damaged length says and reads every byte to find the next
// event; takes are tens of gigabytes and may end in the middle of an event.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "base/io/file.h"
#include "take/logs/log_segments.h"
#include "wire/codec.h"

namespace v3d {

inline constexpr uint32_t kEventSyncWord = 0xEDA1DA01;
inline constexpr size_t kEventHeaderSize = 28;  ///< before the channel's name
/// A longer event is damage: the largest frame, 65536 x 1024 pixels of 16 bits, has half of that.
inline constexpr uint64_t kMaxEventBytes = 256 << 20;

/// Where one event lies.
struct EventSpan {
  std::string channel;
  int64_t utime = 0;         ///< microseconds since 1970
  uint64_t data_offset = 0;  ///< bytes from the beginning of the segment
  uint32_t data_size = 0;
  uint32_t segment = 0;  ///< index into EventLogReader::segments()
};

/// What one segment holds.
struct LogSegment {
  io::File file;
  uint64_t bytes = 0;                 ///< length when it was opened
  std::optional<SegmentIndex> index;  ///< of a recovery
  int64_t events = 0;
  int64_t damaged_places = 0;  ///< between events: bytes that are no event
  uint64_t torn_bytes = 0;     ///< behind the last whole event
  std::string read_error;      ///< of the first bytes that the disk did not give; empty: none
};

/// The events of all segments of one log, in order of recording. Opening reads headers only. The
/// bytes that a recovery found torn (SegmentIndex) are passed over. A read error of the disk is
/// neither an end of file nor damage: the bytes behind it are still searched for events, and
/// read_errors() reports it. One thread.
class EventLogReader {
 public:
  /// Fails when no segment exists or one cannot be opened (EACCES, EMFILE, a FIFO, ...). Bytes that
  /// are no events are no failure.
  [[nodiscard]] static io::Result<EventLogReader> open(const std::filesystem::path& log);
  /// open(), for set-up: throws InputError when it fails, and when the log holds bytes but no whole
  /// event and no recovery has accepted that. An empty file is a log without events.
  explicit EventLogReader(const std::filesystem::path& log);

  const std::vector<EventSpan>& events() const { return events_; }
  const std::vector<LogSegment>& segments() const { return segments_; }
  /// Of all segments: places where something else stood than an event.
  int64_t damaged_places() const;
  /// Of all segments: bytes behind the last whole event that no recovery knows of.
  int64_t torn_bytes() const;
  /// "cannot read /takes/a/cam07.lcmlog: Input/output error (at byte 4096)", one for each segment.
  std::vector<std::string> read_errors() const;

  /// The first `limit` bytes of an event's data. Fails when the disk does not give all of them.
  [[nodiscard]] io::Result<Bytes> read(const EventSpan& event, size_t limit = SIZE_MAX) const;

 private:
  EventLogReader() = default;

  std::vector<LogSegment> segments_;
  std::vector<EventSpan> events_;
};

}  // namespace v3d
