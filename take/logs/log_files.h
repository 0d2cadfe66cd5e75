// Files of a growing log: segments, opening, syncing, holes.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <mutex>
#include <optional>
#include <span>
#include <string_view>
#include <thread>
#include <vector>

#include "base/core/time.h"
#include "base/io/file.h"

namespace v3d::take {

// Segments of an event log: the files of one log, in order of recording.
//
// A log starts in `<name>.lcmlog`. After a restart in the take, the daemon does not change this
// file and continues in `<name>.0001.lcmlog`, then `<name>.0002.lcmlog`, and so on.

inline constexpr int kMaxSegments = 10'000;

/// Path of segment `number`, 0 to kMaxSegments - 1; segment 0 is `log` itself.
std::filesystem::path segment_path(const std::filesystem::path& log, int number);

/// Paths of the existing segments of `log`, in order. Lists the folder, so a gap in the numbers
/// hides no segment. Empty when there is none. Fails when the folder cannot be listed.
[[nodiscard]] io::Result<std::vector<std::filesystem::path>> existing_segments(
    const std::filesystem::path& log);

/// True for the name of a segment of `log`, and for that of the index of one (SegmentIndex).
bool is_of_log(std::string_view file, const std::filesystem::path& log);

/// True when the log certainly has no segment; false when the folder cannot be listed.
bool is_absent_log(const std::filesystem::path& log);

/// Path of the next segment of `log`, after the last of its existing `segments`.
std::filesystem::path next_segment(const std::filesystem::path& log,
                                   const std::vector<std::filesystem::path>& segments);

/// The end of the events of one segment, stored beside it as `<segment>.index` by a recovery, or at
/// the end of a take whose last write failed. The segment itself is never changed: bytes after
/// `whole_bytes` remain, and readers skip them.
struct SegmentIndex {
  uint64_t bytes = 0;          ///< length of the segment when the index was made
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
/// Writes the index with a checksum of its own (take/take_files.h).
[[nodiscard]] io::Status save_segment_index(const std::filesystem::path& segment,
                                            const SegmentIndex& index);

/// Called after each read of a log that is read from begin to end, which may take minutes. An
/// exception ends the reading.
using ReadProgress = std::function<void()>;

// Options for opening a growing file of a take: new or continued, and which checksums to compute.

enum class LogOpening : uint8_t {
  kNew,       ///< creates a new file
  kContinue,  ///< continues the file or log after a restart of the daemon
};

enum class LogHashing : uint8_t {
  kChecksum,  ///< the checksum for the ledger
  kTree,  ///< also the hash tree of the events, for the signature of the take (take_signature.h)
};

// PeriodicSync: syncs a growing file to disk periodically, in a separate thread.

/// Syncs a file once in every period in which it was written to. mark_dirty() and pop_error() do
/// not wait for the disk. One writing thread.
///
/// A write is on disk one period and the duration of a sync after mark_dirty(), unless a sync takes
/// longer than a period. Periods begin at multiples of their length on the monotonic clock, so that
/// all files of a host are synced at the same time: a file system then commits its journal once for
/// all of them.
class PeriodicSync {
 public:
  /// `file` must outlive the object.
  PeriodicSync(const io::File& file, Duration period);
  /// Waits for a running sync; does not sync later writes.
  ~PeriodicSync();
  PeriodicSync(const PeriodicSync&) = delete;
  PeriodicSync& operator=(const PeriodicSync&) = delete;

  void mark_dirty();
  /// The first error since the last call: earlier writes may be lost.
  [[nodiscard]] io::Status pop_error();
  /// Syncs in the calling thread, after a running sync. Returns its error, or that of an earlier
  /// sync as pop_error() does.
  [[nodiscard]] io::Status sync();

 private:
  void run();
  bool wait_until(MonotonicInstant instant);
  void sync_file();

  const io::File& file_;
  const Duration period_;
  std::mutex sync_mutex_;  ///< held during a sync: the kernel reports an error to one sync only
  std::mutex mutex_;       ///< guards the members below
  std::condition_variable stopped_;
  bool stopping_ = false;
  bool is_dirty_ = false;
  io::Status failure_;
  std::thread thread_;  ///< declared last: starts after all other members exist
};

/// True for errors of fsync() and sync_file_range() that mean that the file system does not support
/// the call. Every other error means that written bytes may be lost.
bool is_unsupported_sync(int error);

// Access to sparse files, whose holes use no disk space and read as zeros.

/// Offset of the first byte from `offset` on that is not in a hole (lseek SEEK_DATA); the end of
/// the file if only a hole follows. Returns `offset` when the file system does not support holes.
///
/// The duration of a search depends on the amount of data, not on the length of the file. One
/// thread at a time for each file.
uint64_t next_data(const io::File& file, uint64_t offset);

/// Reads a whole file in ascending order without reading its holes, for checksums: a file of any
/// length that takes little room on the disk is read, or rejected, in seconds. One thread.
class SparseReader {
 public:
  /// Limit of the bytes in holes. V3D writes no holes; copies by other programs may have some where
  /// the original has zeros.
  static constexpr uint64_t kMaxHoleBytes = uint64_t{16} << 30;

  /// `file` must outlive the object.
  explicit SparseReader(const io::File& file) : file_(file) {}

  /// Like io::File::read_whole(), with offsets that do not descend. Bytes in holes are zeros. Fails
  /// with EFBIG when the holes up to here have more than kMaxHoleBytes.
  [[nodiscard]] io::Status read_whole(uint64_t offset, std::span<uint8_t> bytes);

 private:
  const io::File& file_;
  uint64_t hole_end_ = 0;  ///< end of the last hole that was found
  uint64_t holes_ = 0;     ///< bytes in holes before hole_end_
};

}  // namespace v3d::take
