// Segments of an event log: the files that recording made of one log, in order.
//
// A log begins in `<name>.lcmlog`. A daemon that is restarted in a take leaves every byte of that
// file as it is and continues in `<name>.0001.lcmlog`, then `<name>.0002.lcmlog`, and so on.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <vector>

#include "base/io/result.h"

namespace v3d {

inline constexpr int kMaxSegments = 10'000;

/// The file of segment `number`, 0 to kMaxSegments - 1; segment 0 is `log` itself.
std::filesystem::path segment_path(const std::filesystem::path& log, int number);

/// The segments of `log` that exist, in order, by the names in its folder: a gap in their numbers
/// hides none. Empty when there is none. Fails when the folder cannot be listed.
[[nodiscard]] io::Result<std::vector<std::filesystem::path>> existing_segments(
    const std::filesystem::path& log);

/// True when the log surely has no segment; false when the folder cannot be listed.
bool is_absent_log(const std::filesystem::path& log);

/// The file that recording into `log` continues in: behind the last of its existing `segments`.
std::filesystem::path next_segment(const std::filesystem::path& log,
                                   const std::vector<std::filesystem::path>& segments);

/// What a recovery found in a segment, kept beside it as `<segment>.index`. The segment itself is
/// never changed: bytes behind `whole_bytes` stay, and readers pass over them.
struct SegmentIndex {
  uint64_t bytes = 0;          ///< length of the segment when it was recovered
  uint64_t whole_bytes = 0;    ///< end of the last event that is whole and has the right checksum
  int64_t events = 0;          ///< events before that
  int64_t damaged_places = 0;  ///< places before that where no event could be read

  friend bool operator==(const SegmentIndex&, const SegmentIndex&) = default;
};

std::filesystem::path segment_index_path(const std::filesystem::path& segment);
/// Empty when there is none, when it cannot be read, or when the segment has another length.
std::optional<SegmentIndex> load_segment_index(const std::filesystem::path& segment,
                                               uint64_t segment_bytes);
[[nodiscard]] io::Status save_segment_index(const std::filesystem::path& segment,
                                            const SegmentIndex& index);

}  // namespace v3d
