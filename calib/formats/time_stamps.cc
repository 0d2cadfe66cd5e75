#include "calib/formats/time_stamps.h"

#include <algorithm>
#include <charconv>
#include <optional>
#include <vector>

#include "base/core/error.h"

namespace v3d::calib {
namespace {

std::vector<std::string_view> fields_of(std::string_view line) {
  std::vector<std::string_view> fields;
  while (true) {
    const size_t comma = line.find(',');
    std::string_view field = line.substr(0, comma);
    while (!field.empty() && (field.front() == ' ' || field.front() == '"')) field.remove_prefix(1);
    while (!field.empty() && (field.back() == ' ' || field.back() == '"' || field.back() == '\r')) {
      field.remove_suffix(1);
    }
    fields.push_back(field);
    if (comma == std::string_view::npos) return fields;
    line.remove_prefix(comma + 1);
  }
}

/// An integer from 0 to 2^53, so that differences cannot overflow.
std::optional<int64_t> whole_number(std::string_view text) {
  constexpr int64_t kMax = int64_t{1} << 53;
  int64_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return value >= 0 && value < kMax ? std::optional(value) : std::nullopt;
}

struct Columns {
  size_t instant, camera, frame;
};

Columns find_columns(std::string_view header, const std::filesystem::path& path) {
  const std::vector<std::string_view> names = fields_of(header);
  const auto column = [&](std::string_view name, std::string_view other) {
    const auto found =
        std::find_if(names.begin(), names.end(), [&](auto n) { return n == name || n == other; });
    if (found == names.end()) {
      throw InputError(path.string() + ":1: no column " + std::string(name) +
                       "; expected sync_index,cam_id,frame_index");
    }
    return static_cast<size_t>(found - names.begin());
  };
  return {column("sync_index", "sync_index"), column("cam_id", "port"),
          column("frame_index", "frame_index")};
}

/// The number at the end of a name: "2" for "cam_2" and "cam02"; else the whole name.
std::string id_of(const std::string& camera) {
  const size_t last = camera.find_last_not_of("0123456789");
  if (last == std::string::npos || last + 1 == camera.size()) return camera;
  const std::string digits = camera.substr(last + 1);
  return digits.substr(std::min(digits.find_first_not_of('0'), digits.size() - 1));
}

}  // namespace

TimeStamps parse_time_stamps(std::string_view csv, const std::filesystem::path& path) {
  const size_t header_end = std::min(csv.find('\n'), csv.size());
  const Columns columns = find_columns(csv.substr(0, header_end), path);
  const size_t min_fields = 1 + std::max({columns.instant, columns.camera, columns.frame});
  TimeStamps stamps;
  int line_number = 1;
  csv.remove_prefix(std::min(header_end + 1, csv.size()));
  while (!csv.empty()) {
    const size_t end = std::min(csv.find('\n'), csv.size());
    const std::string_view line = csv.substr(0, end);
    csv.remove_prefix(std::min(end + 1, csv.size()));
    ++line_number;
    const auto fields = fields_of(line);
    if (fields.size() == 1 && fields[0].empty()) continue;
    if (fields.size() < min_fields) {
      throw InputError(path.string() + ":" + std::to_string(line_number) + ": too few columns");
    }
    if (fields[columns.frame].empty()) continue;  // this camera has no image of the instant
    const auto instant = whole_number(fields[columns.instant]);
    const auto frame = whole_number(fields[columns.frame]);
    if (!instant || !frame) {
      throw InputError(path.string() + ":" + std::to_string(line_number) +
                       ": sync_index and frame_index must be integers, 0 or more");
    }
    stamps[std::string(fields[columns.camera])][*frame] = *instant;
  }
  return stamps;
}

std::map<int64_t, int64_t> frame_instants(const TimeStamps& stamps, const std::string& camera,
                                          int64_t frames, const std::filesystem::path& path) {
  auto found = stamps.find(camera);
  if (found == stamps.end()) found = stamps.find(id_of(camera));
  if (found == stamps.end() || found->second.empty()) {
    throw InputError(path.string() + ": no time stamps of camera " + camera);
  }
  const bool exceeds = frames > 0 && found->second.rbegin()->first >= frames;
  const int64_t first = exceeds ? found->second.begin()->first : 0;
  std::map<int64_t, int64_t> instants;
  for (const auto& [frame, instant] : found->second) instants[frame - first] = instant;
  return instants;
}

}  // namespace v3d::calib
