#include "take/log_segments.h"

#include <algorithm>
#include <string>

#include "base/error.h"
#include "base/io/file.h"
#include "base/toml_file.h"

namespace v3d {
namespace {

namespace fs = std::filesystem;

constexpr size_t kDigits = 4;

uint64_t count_of(const TomlTable& table, const char* key) {
  const int64_t value = table.integer(key);
  if (value < 0) table.fail(key, "expected a count, 0 or more");
  return static_cast<uint64_t>(value);
}

SegmentIndex parse_index(std::string_view text, const fs::path& path) {
  const TomlTable table = TomlTable::parse(text, path);
  SegmentIndex index{.bytes = count_of(table, "bytes"),
                     .whole_bytes = count_of(table, "whole_bytes"),
                     .events = static_cast<int64_t>(count_of(table, "events")),
                     .damaged_places = static_cast<int64_t>(count_of(table, "damaged_places"))};
  table.refuse_unknown();
  return index;
}

}  // namespace

fs::path segment_path(const fs::path& log, int number) {
  if (number == 0) return log;
  std::string digits = std::to_string(number);
  digits.insert(0, kDigits - std::min(kDigits, digits.size()), '0');
  return log.parent_path() / (log.stem().string() + "." + digits + log.extension().string());
}

std::vector<fs::path> existing_segments(const fs::path& log) {
  std::vector<fs::path> segments;
  for (int number = 0; number < kMaxSegments; ++number) {
    fs::path segment = segment_path(log, number);
    std::error_code error;
    const bool is_missing = fs::symlink_status(segment, error).type() == fs::file_type::not_found;
    if (!is_missing) segments.push_back(std::move(segment));
    if (is_missing && number > 0) break;
  }
  return segments;
}

fs::path segment_index_path(const fs::path& segment) { return segment.string() + ".index"; }

std::optional<SegmentIndex> load_segment_index(const fs::path& segment, uint64_t segment_bytes) {
  const fs::path path = segment_index_path(segment);
  const auto text = io::read_file(path, 4096);
  if (!text) return std::nullopt;
  try {
    const SegmentIndex index = parse_index(*text, path);
    if (index.bytes != segment_bytes || index.whole_bytes > index.bytes) return std::nullopt;
    return index;
  } catch (const InputError&) {
    return std::nullopt;
  }
}

io::Status save_segment_index(const fs::path& segment, const SegmentIndex& index) {
  return io::replace_file(segment_index_path(segment),
                          "bytes = " + std::to_string(index.bytes) +
                              "\nwhole_bytes = " + std::to_string(index.whole_bytes) +
                              "\nevents = " + std::to_string(index.events) +
                              "\ndamaged_places = " + std::to_string(index.damaged_places) + "\n");
}

}  // namespace v3d
