// <camera>.lcmlog: frames as LCM event logs, so that lcm-logplayer and lcm-spy open them.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "take/log_opening.h"
#include "wire/messages.h"

namespace v3d {

/// Appends events; one thread. A log that goes on must end with a whole event (recover_take()).
/// Nothing is buffered here: what write() said yes to survives the end of the program, and a crash
/// leaves at most one unfinished event behind it. At most 32 MB are not on the disk yet: write()
/// then waits for the disk, so that close() is quick.
class EventLogWriter {
 public:
  /// Creates the file where there is none. Throws InputError when that fails.
  explicit EventLogWriter(const std::filesystem::path& path, LogOpening opening = LogOpening::kNew);
  ~EventLogWriter();
  EventLogWriter(EventLogWriter&&) noexcept;
  EventLogWriter& operator=(EventLogWriter&&) noexcept;

  /// False when the disk refused, now or what it had been given before; the log then ends with the
  /// event before.
  bool write(const FrameMessage& message);
  bool write(const PulseMessage& message);
  int64_t bytes() const;
  /// Waits until everything is on the disk, and ends the log. False when the disk refused any of
  /// it.
  bool close();

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

/// Random access to the frames of one camera by pulse number. Opening reads the headers of all
/// events; a torn last event is left out and reported. One thread per reader.
class FrameLogReader {
 public:
  /// Throws InputError when the file is missing or is no event log.
  explicit FrameLogReader(const std::filesystem::path& path);
  ~FrameLogReader();
  FrameLogReader(FrameLogReader&&) noexcept;
  FrameLogReader& operator=(FrameLogReader&&) noexcept;

  /// In the order of the file, duplicates included.
  const std::vector<FrameLabel>& labels() const;
  /// Events that do not decode, and bytes behind the last whole event.
  int64_t damaged_events() const;
  int64_t torn_bytes() const;
  /// The first frame of this pulse; empty when there is none or it is damaged.
  std::optional<Frame> read(int64_t pulse);

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

/// All pulses of pulses.lcmlog, in order; damaged events are passed over. Throws InputError as
/// FrameLogReader does.
std::vector<PulseMessage> read_pulses(const std::filesystem::path& path);

}  // namespace v3d
