// EventLogWriter and FrameLogReader: write and read the frames of one camera as LCM event logs
// (<camera>.lcmlog), which lcm-logplayer and lcm-spy can open.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/core/time.h"
#include "base/io/file.h"
#include "take/logs/log_files.h"
#include "take/take_files.h"
#include "wire/messages.h"

namespace v3d::take {

/// Appends events to a new segment of a log (take/logs/log_files.h). Changes no byte of an
/// existing file. One thread.
///
/// Unbuffered: a frame for which write() returned true survives the end of the program, and a crash
/// leaves at most one unfinished event after it.
///
/// A separate thread syncs the file once a second while it grows (PeriodicSync): a power cut loses
/// at most the events of the last second and of the duration of a sync. write() does not wait for
/// these syncs. It waits for the disk when more than 32 MB are not written back, so that a sync
/// takes little time.
class EventLogWriter {
 public:
  static constexpr Duration kSyncPeriod = std::chrono::seconds(1);

  /// kNew creates the first segment and fails when the log exists; kContinue creates the segment
  /// after the last one. Throws InputError when the file cannot be created. The caller must sync
  /// the folder. `earlier_events`: number of events in the log that is continued; where it is
  /// empty, and a segment has no index, they are counted, which reads the log.
  explicit EventLogWriter(const std::filesystem::path& path, LogOpening opening = LogOpening::kNew,
                          LogHashing hashing = LogHashing::kChecksum,
                          Duration sync_period = kSyncPeriod,
                          std::optional<int64_t> earlier_events = {});
  ~EventLogWriter();
  EventLogWriter(EventLogWriter&&) noexcept;
  EventLogWriter& operator=(EventLogWriter&&) noexcept;

  /// Appends one event. Fails when the disk reports an error: the event is then not in the log, but
  /// a later one may succeed. After the disk lost bytes that it had accepted, every call fails.
  [[nodiscard]] io::Status write(const wire::FrameMessage& message);
  /// `edge_here`: time of the pulse on this PC's CLOCK_REALTIME, which is then the time of the
  /// event (EventSpan::utime); else that is the time of sending.
  [[nodiscard]] io::Status write(const wire::PulseMessage& message,
                                 std::optional<RealtimeInstant> edge_here = {});
  int64_t bytes() const;                      ///< end of the last event, in this segment
  const std::filesystem::path& path() const;  ///< path of this segment
  /// Name, length and checksum of this segment, and its root with LogHashing::kTree. Computed from
  /// the bytes that were passed to the kernel; after end(), also from those of a failed write.
  TakeFile file() const;
  /// Waits until all events are on disk. Fails when the disk lost any of them, now or earlier.
  [[nodiscard]] io::Status sync();
  /// Call it once, after the last event. sync(), then adds to file() what a failed write has left
  /// behind the last event: no event overwrites it any more, and no file of a take is shortened.
  /// Fails as sync() does, and when these bytes cannot be read.
  [[nodiscard]] io::Status end();
  /// After end(): writes the index of this segment (SegmentIndex) where a failed write has left
  /// bytes behind the last event, so that readers skip them as after a recovery. After the sync,
  /// because no recovery examines the events of a segment that has an index. Without the index,
  /// readers find the same frames, and report an unfinished event until a recovery writes it.
  [[nodiscard]] io::Status save_index() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

class EventLogReader;

/// Random access to the frames of one camera by pulse number, over all segments of its log. Opening
/// reads the headers of all events; a torn last event is skipped and reported. One thread per
/// reader.
class FrameLogReader {
 public:
  /// Reads the head of each frame; `progress` and `from` are as for EventLogReader::open(). Throws
  /// InputError as EventLogReader does.
  explicit FrameLogReader(const std::filesystem::path& path, const ReadProgress& progress = {},
                          uint64_t from = 0);
  ~FrameLogReader();
  FrameLogReader(FrameLogReader&&) noexcept;
  FrameLogReader& operator=(FrameLogReader&&) noexcept;

  /// Labels of all frames in file order, including duplicates.
  const std::vector<FrameLabel>& labels() const;
  /// Number of whole events, including those that are no frames.
  int64_t events() const;
  /// Number of events that cannot be decoded, and bytes after the last whole event.
  int64_t damaged_events() const;
  int64_t torn_bytes() const;
  /// The read errors until now, with path and cause. read() adds errors up to a total of 16.
  const std::vector<std::string>& read_errors() const;
  /// The first frame of `pulse` that is not suspect, else the first one, with 8 bits per sample
  /// (reduce_to_8_bits()). Empty when there is none, or it is damaged or unreadable.
  std::optional<Frame> read(int64_t pulse);
  /// Like read(), with all recorded bits of a deep image.
  std::optional<Frame> read_deep(int64_t pulse);

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

/// A frame in the middle of the log (find_middle_event()), with 8 bits per sample, for previews.
/// Reads little more than this frame, whatever the length of the log. Empty when no frame there can
/// be decoded. Throws InputError when the log cannot be opened.
std::optional<Frame> read_middle_frame(const std::filesystem::path& log);

/// Limit of the data of a pulse event, bytes; written events have about 100. Readers ignore longer
/// events without reading them: in a sparse file, an event can claim up to 256 MB.
inline constexpr uint32_t kMaxPulseBytes = 4 << 10;

/// All pulses of pulses.lcmlog, in order. Ignores damaged events and events longer than
/// kMaxPulseBytes. Throws InputError as FrameLogReader does, and on read errors.
std::vector<wire::PulseMessage> read_pulses(const std::filesystem::path& path,
                                            const ReadProgress& progress = {});
std::vector<wire::PulseMessage> read_pulses(const EventLogReader& log,
                                            const ReadProgress& progress = {});

}  // namespace v3d::take
