// EventLogWriter and FrameLogReader: the frames of one camera as LCM event logs (<camera>.lcmlog),
// which lcm-logplayer and lcm-spy open.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/io/result.h"
#include "take/logs/log_opening.h"
#include "take/take_files.h"
#include "wire/messages.h"

namespace v3d {

/// Appends events to a new segment of a log (take/logs/log_segments.h); one thread. Nothing is
/// buffered here: a frame for which write() returned true survives the end of the program, and a
/// crash leaves at most one unfinished event behind it. At most 32 MB are not on the disk yet:
/// write() then waits for the disk, so that sync() is quick. No byte of an existing file is
/// changed.
class EventLogWriter {
 public:
  /// kNew creates the first segment and fails when the log exists; kGoOn creates the segment behind
  /// the last one. Throws InputError when the file cannot be created. The caller syncs the folder.
  explicit EventLogWriter(const std::filesystem::path& path, LogOpening opening = LogOpening::kNew,
                          LogHashing hashing = LogHashing::kChecksum);
  ~EventLogWriter();
  EventLogWriter(EventLogWriter&&) noexcept;
  EventLogWriter& operator=(EventLogWriter&&) noexcept;

  /// Fails when the disk reports an error: the event is then not in the log, and a later one may
  /// be. Once the disk has lost bytes that it had accepted, every call fails.
  [[nodiscard]] io::Status write(const FrameMessage& message);
  [[nodiscard]] io::Status write(const PulseMessage& message);
  int64_t bytes() const;                      ///< of this segment
  const std::filesystem::path& path() const;  ///< of this segment
  /// Name, length, checksum and, with LogHashing::kTree, root of this segment, as they were given
  /// to the kernel.
  TakeFile file() const;
  /// Waits until everything is on the disk. Fails when the disk lost any of it, now or before.
  [[nodiscard]] io::Status sync();

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

/// Random access to the frames of one camera by pulse number, over all segments of its log. Opening
/// reads the headers of all events; a torn last event is left out and reported. One thread per
/// reader.
class FrameLogReader {
 public:
  /// Throws InputError as EventLogReader does.
  explicit FrameLogReader(const std::filesystem::path& path);
  ~FrameLogReader();
  FrameLogReader(FrameLogReader&&) noexcept;
  FrameLogReader& operator=(FrameLogReader&&) noexcept;

  /// In the order of the file, duplicates included.
  const std::vector<FrameLabel>& labels() const;
  /// Events that do not decode, and bytes behind the last whole event.
  int64_t damaged_events() const;
  int64_t torn_bytes() const;
  /// What the disk did not give until now, at most some lines with path and cause.
  const std::vector<std::string>& read_errors() const;
  /// The first frame of this pulse; empty when there is none, or it is damaged or cannot be read.
  std::optional<Frame> read(int64_t pulse);

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

/// Limit of the data of a pulse event, bytes; ours have about 100. Readers ignore longer events
/// without reading them: in a sparse file, an event can claim up to 256 MB.
inline constexpr uint32_t kMaxPulseBytes = 4 << 10;

/// All pulses of pulses.lcmlog, in order. Ignores damaged events and those above kMaxPulseBytes.
/// Throws InputError as FrameLogReader does, and when the disk does not give all bytes.
std::vector<PulseMessage> read_pulses(const std::filesystem::path& path);

}  // namespace v3d
