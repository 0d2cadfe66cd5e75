// Indexes of log segments (SegmentIndex), which a recovery makes, and messages of events.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "base/io/file.h"
#include "take/logs/event_log.h"
#include "wire/codec.h"
#include "wire/messages.h"

namespace v3d::take {

/// The head of a frame. Empty when the event does not start as a frame of its length; then the
/// length is not trusted and no further bytes are read.
io::Result<std::optional<wire::FrameHead>> read_head(const EventLogReader& log,
                                                     const EventSpan& event);

/// The message of an event; empty when it is damaged.
template <class Message>
io::Result<std::optional<Message>> read_message(const EventLogReader& log, const EventSpan& event) {
  const auto bytes = log.read(event);
  if (!bytes) return tl::make_unexpected(bytes.error());
  return wire::decode<Message>(*bytes);
}

/// Problems that a recovery finds before it counts pulses and frames.
struct IndexProblems {
  std::vector<std::string> read_errors;  ///< of segments
  std::vector<std::string> notes;        ///< of indexes that are replaced
};

/// Writes the index of every segment that has none, or none that can be used. A segment with a read
/// error gets no index, and the next recovery retries.
template <class Message>  // wire::PulseMessage, wire::FrameMessage
io::Status index_segments(const std::filesystem::path& path, IndexProblems& problems,
                          const ReadProgress& progress = {});

}  // namespace v3d::take
