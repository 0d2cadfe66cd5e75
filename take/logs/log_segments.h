// Segments of an event log: the files of one log, in order of recording.
//
// A log starts in `<name>.lcmlog`. After a restart in the take, the daemon does not change this
// file and continues in `<name>.0001.lcmlog`, then `<name>.0002.lcmlog`, and so on.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <vector>

#include "base/io/result.h"

namespace v3d {

inline constexpr int kMaxSegments = 10'000;

/// Path of segment `number`, 0 to kMaxSegments - 1; segment 0 is `log` itself.
std::filesystem::path segment_path(const std::filesystem::path& log, int number);

/// Paths of the existing segments of `log`, in order. Lists the folder, so a gap in the numbers
/// hides no segment. Empty when there is none. Fails when the folder cannot be listed.
[[nodiscard]] io::Result<std::vector<std::filesystem::path>> existing_segments(
    const std::filesystem::path& log);

/// True when the log certainly has no segment; false when the folder cannot be listed.
bool is_absent_log(const std::filesystem::path& log);

/// Path of the next segment of `log`, after the last of its existing `segments`.
std::filesystem::path next_segment(const std::filesystem::path& log,
                                   const std::vector<std::filesystem::path>& segments);

/// The result of a recovery of one segment, stored beside it as `<segment>.index`. The segment
/// itself is never changed: bytes after `whole_bytes` remain, and readers skip them.
struct SegmentIndex {
  uint64_t bytes = 0;          ///< length of the segment at the recovery
  uint64_t whole_bytes = 0;    ///< end of the last whole event with a correct checksum
  int64_t events = 0;          ///< number of events before `whole_bytes`
  int64_t damaged_places = 0;  ///< gaps before `whole_bytes` without a readable event

  friend bool operator==(const SegmentIndex&, const SegmentIndex&) = default;
};

std::filesystem::path segment_index_path(const std::filesystem::path& segment);
/// Reads the index of `segment`, which has `segment_bytes` bytes. Empty when there is none. Fails
/// with one line when it cannot be read, is damaged, or is that of a segment of another length: the
/// segment must then be searched for events, because a wrong index would hide them.
[[nodiscard]] io::Result<std::optional<SegmentIndex>> load_segment_index(
    const std::filesystem::path& segment, uint64_t segment_bytes);
/// Writes the index with a checksum of its own (take/checksummed_text.h).
[[nodiscard]] io::Status save_segment_index(const std::filesystem::path& segment,
                                            const SegmentIndex& index);

}  // namespace v3d
