// EventLogReader: random access to the events of an LCM event log, which may be damaged.
//
// LCM's own reader is not used: it allocates memory for any damaged length, and reads every byte to
// find the next event. Takes are tens of gigabytes and may end in the middle of an event.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "base/io/file.h"
#include "take/logs/log_files.h"
#include "wire/codec.h"

namespace v3d::take {

inline constexpr uint32_t kEventSyncWord = 0xEDA1DA01;
inline constexpr size_t kEventHeaderSize = 28;  ///< before the channel's name
/// Limit of the name of a channel. LCM permits 63 characters; earlier versions of V3D recorded
/// cameras with longer names.
inline constexpr size_t kMaxChannelSize = 74;
/// Limit of the data of an event, bytes. A longer event is damaged: the largest frame, 65536 x 1024
/// pixels of 16 bits, has half of this.
inline constexpr uint64_t kMaxEventBytes = 256 << 20;

/// Position of one event in its log.
struct EventSpan {
  std::string channel;
  int64_t utime = 0;         ///< microseconds since 1970
  uint64_t data_offset = 0;  ///< bytes from the start of the segment
  uint32_t data_size = 0;
  uint32_t segment = 0;  ///< index into EventLogReader::segments()
};

/// One segment of a log, and what was found in it.
struct LogSegment {
  io::File file;
  uint64_t bytes = 0;                 ///< length when the segment was opened
  std::optional<SegmentIndex> index;  ///< result of a recovery, if any
  int64_t events = 0;
  int64_t damaged_places = 0;  ///< gaps between events: bytes that are not an event
  uint64_t torn_bytes = 0;     ///< bytes after the last whole event
  std::string read_error;      ///< first read error of the disk; empty: none
  std::string index_error;     ///< why its index is not used (load_segment_index()); empty: none
};

/// The events of all segments of one log, in order of recording. Opening reads headers only.
///
/// Skips the bytes that a recovery found torn (SegmentIndex). A segment whose index is damaged is
/// searched as one without an index. A read error of the disk is not
/// treated as end of file or damage: the bytes after it are searched for events, and read_errors()
/// reports it. One thread.
class EventLogReader {
 public:
  /// Opens all segments of `log`. Fails when no segment exists or one cannot be opened (EACCES,
  /// EMFILE, a FIFO, ...). Bytes that are not events are no failure. `from`: the end of an event of
  /// the first segment; the events before it are left out.
  [[nodiscard]] static io::Result<EventLogReader> open(const std::filesystem::path& log,
                                                       const ReadProgress& progress = {},
                                                       uint64_t from = 0);
  /// Like open(), for set-up. Throws InputError when open() fails, and when the log contains bytes
  /// but no whole event and has no index of a recovery. An empty file is a log without events.
  explicit EventLogReader(const std::filesystem::path& log, const ReadProgress& progress = {},
                          uint64_t from = 0);

  const std::vector<EventSpan>& events() const { return events_; }
  const std::vector<LogSegment>& segments() const { return segments_; }
  /// Number of gaps between events, over all segments.
  int64_t damaged_places() const;
  /// Bytes after the last whole event that no recovery has recorded, over all segments.
  int64_t torn_bytes() const;
  /// The first read error of each segment: "cannot read /takes/a/cam07.lcmlog: Input/output error
  /// (at byte 4096)".
  std::vector<std::string> read_errors() const;

  /// Reads the first `limit` bytes of an event's data. Fails on read errors, also when the file
  /// became shorter.
  [[nodiscard]] io::Result<wire::Bytes> read(const EventSpan& event, size_t limit = SIZE_MAX) const;

 private:
  EventLogReader() = default;

  std::vector<LogSegment> segments_;
  std::vector<EventSpan> events_;
};

// Search for an event in the middle of a log, which does not read the events before it.

/// Whether the search ends with this event of this segment. The number of the segment is unknown.
using EventTest = std::function<bool(const io::File& segment, const EventSpan& event)>;

/// Limit of the bytes that are searched from one place of a damaged log.
inline constexpr uint64_t kMaxSearchedBytes = kMaxEventBytes;

/// Passes whole events of `log` to `is_wanted` until it returns true. Begins at the event at the
/// middle byte of the log. Continues from the start of that segment and of the others, where the
/// middle has no such event. In a log of events of one size, the search reads one block, whatever
/// the length of the log.
/// Returns false when no event is wanted. Fails when no segment exists or none can be opened.
[[nodiscard]] io::Result<bool> find_middle_event(const std::filesystem::path& log,
                                                 const EventTest& is_wanted);

}  // namespace v3d::take
