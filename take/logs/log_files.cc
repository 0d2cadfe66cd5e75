#include "take/logs/log_files.h"

#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <map>
#include <string>
#include <utility>

#include "base/config/toml_file.h"
#include "base/core/error.h"
#include "base/core/text.h"
#include "base/io/file.h"
#include "take/take_files.h"

namespace v3d::take {
namespace {

namespace fs = std::filesystem;

constexpr size_t kDigits = 4;

uint64_t count_of(const TomlTable& table, const char* key) {
  const int64_t value = table.integer(key);
  if (value < 0) table.fail(key, "expected a count, 0 or more");
  return static_cast<uint64_t>(value);
}

SegmentIndex parse_index(std::string_view text, const fs::path& path) {
  const TomlTable table = parse_checksummed(text, path);
  SegmentIndex index{.bytes = count_of(table, "bytes"),
                     .whole_bytes = count_of(table, "whole_bytes"),
                     .events = static_cast<int64_t>(count_of(table, "events")),
                     .damaged_places = static_cast<int64_t>(count_of(table, "damaged_places"))};
  table.reject_unknown_fields();
  return index;
}

/// The segment number of a file name in `log`; empty for other files.
std::optional<int> number_of(const std::string& file, const fs::path& log) {
  if (file == log.filename()) return 0;
  const std::string before = log.stem().string() + ".", after = log.extension().string();
  if (file.size() != before.size() + kDigits + after.size()) return std::nullopt;
  if (!file.starts_with(before) || !file.ends_with(after)) return std::nullopt;
  int number = 0;
  const char* const begin = file.data() + before.size();
  const auto parsed = std::from_chars(begin, begin + kDigits, number);
  return parsed.ec == std::errc() && parsed.ptr == begin + kDigits && number > 0
             ? std::optional(number)
             : std::nullopt;
}

}  // namespace

fs::path segment_path(const fs::path& log, int number) {
  if (number == 0) return log;
  std::string digits = std::to_string(number);
  digits.insert(0, kDigits - std::min(kDigits, digits.size()), '0');
  return log.parent_path() / (log.stem().string() + "." + digits + log.extension().string());
}

io::Result<std::vector<fs::path>> existing_segments(const fs::path& log) {
  const fs::path folder = log.has_parent_path() ? log.parent_path() : fs::path(".");
  const auto entries = io::list_folder(folder);
  if (!entries) return tl::make_unexpected(entries.error());
  std::map<int, fs::path> segments;
  for (const fs::path& entry : *entries) {
    const auto number = number_of(entry.filename().string(), log);
    if (number) segments.emplace(*number, segment_path(log, *number));
  }
  std::vector<fs::path> paths;
  for (auto& [number, path] : segments) paths.push_back(std::move(path));
  return paths;
}

bool is_of_log(std::string_view file, const fs::path& log) {
  constexpr std::string_view kIndex = ".index";
  if (file.ends_with(kIndex)) file.remove_suffix(kIndex.size());
  return number_of(std::string(file), log).has_value();
}

bool is_absent_log(const fs::path& log) {
  const auto segments = existing_segments(log);
  return segments && segments->empty();
}

fs::path next_segment(const fs::path& log, const std::vector<fs::path>& segments) {
  const int last =
      segments.empty() ? -1 : number_of(segments.back().filename().string(), log).value_or(0);
  return segment_path(log, last + 1);
}

fs::path segment_index_path(const fs::path& segment) { return segment.string() + ".index"; }

io::Result<std::optional<SegmentIndex>> load_segment_index(const fs::path& segment,
                                                           uint64_t segment_bytes) {
  const fs::path path = segment_index_path(segment);
  const auto text = io::read_file(path, 4096, io::OpenMode::kReadWithinFolder);
  if (!text && text.error().code == ENOENT) return std::nullopt;
  if (!text) return tl::make_unexpected(text.error());
  try {
    const SegmentIndex index = parse_index(*text, path);
    if (index.bytes == segment_bytes && index.whole_bytes <= index.bytes) return index;
    return io::io_error("use", path,
                        "it is the index of a segment of " + std::to_string(index.bytes) +
                            " bytes, this one has " + std::to_string(segment_bytes));
  } catch (const InputError& error) {
    return tl::make_unexpected(io::IoError{.code = EBADMSG, .message = error.what()});
  }
}

io::Status save_segment_index(const fs::path& segment, const SegmentIndex& index) {
  TomlWriter file;
  file.integer("bytes", index.bytes)
      .integer("whole_bytes", index.whole_bytes)
      .integer("events", index.events)
      .integer("damaged_places", index.damaged_places);
  return io::replace_file(segment_index_path(segment), with_checksum(file.written()));
}

namespace {

/// The first multiple of `period` after `now`.
MonotonicInstant next_period(MonotonicInstant now, Duration period) {
  return now - now.time_since_epoch() % period + period;
}

}  // namespace

PeriodicSync::PeriodicSync(const io::File& file, Duration period)
    : file_(file), period_(period), thread_([this] { run(); }) {}

PeriodicSync::~PeriodicSync() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  stopped_.notify_one();
  thread_.join();
}

void PeriodicSync::mark_dirty() {
  const std::lock_guard lock(mutex_);
  is_dirty_ = true;
}

io::Status PeriodicSync::pop_error() {
  const std::lock_guard lock(mutex_);
  return std::exchange(failure_, io::Status());
}

io::Status PeriodicSync::sync() {
  sync_file();
  return pop_error();
}

void PeriodicSync::run() {
  MonotonicInstant next = next_period(Monotonic::now(), period_);
  while (wait_until(next)) {
    next = next_period(Monotonic::now(), period_);  // before the sync, which may take long
    bool is_due = false;
    {
      const std::lock_guard lock(mutex_);
      is_due = is_dirty_;
    }
    if (is_due) sync_file();
  }
}

/// False when the object is being destroyed.
bool PeriodicSync::wait_until(MonotonicInstant instant) {
  std::unique_lock lock(mutex_);
  return !stopped_.wait_for(lock, instant - Monotonic::now(), [this] { return stopping_; });
}

/// Syncs the file and stores the first error.
void PeriodicSync::sync_file() {
  const std::lock_guard syncing(sync_mutex_);
  {
    const std::lock_guard lock(mutex_);
    is_dirty_ = false;
  }
  io::Status synced = file_.sync();
  if (synced || is_unsupported_sync(synced.error().code)) return;
  const std::lock_guard lock(mutex_);
  if (failure_) failure_ = std::move(synced);
}

bool is_unsupported_sync(int error) {
  return error == EINVAL || error == ENOSYS || error == EOPNOTSUPP;
}

uint64_t next_data(const io::File& file, uint64_t offset) {
  const off_t data = lseek(file.fd(), static_cast<off_t>(offset), SEEK_DATA);
  if (data >= 0) return static_cast<uint64_t>(data);
  if (errno != ENXIO) return offset;
  return file.size().value_or(offset);
}

io::Status SparseReader::read_whole(uint64_t offset, std::span<uint8_t> bytes) {
  if (offset >= hole_end_) {
    hole_end_ = std::max(offset, next_data(file_, offset));
    holes_ += hole_end_ - offset;
  }
  if (holes_ > kMaxHoleBytes) {
    return io::io_error("read", file_.path(),
                        "it has " + format_count(static_cast<int64_t>(holes_)) +
                            " bytes in holes; expected at most " +
                            format_count(static_cast<int64_t>(kMaxHoleBytes)),
                        EFBIG);
  }
  if (hole_end_ - offset < bytes.size()) return file_.read_whole(offset, bytes);
  std::ranges::fill(bytes, uint8_t{0});
  return {};
}

}  // namespace v3d::take
