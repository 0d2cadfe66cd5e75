#include "sim/cameras/exposure_record.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cinttypes>
#include <string_view>

#include "base/core/error.h"
#include "base/io/file.h"

namespace v3d::sim {
namespace {

constexpr std::array<std::string_view, 6> kColumns = {
    "camera", "device_time_ns", "edge_monotonic_ns", "edge", "image_index", "xxh3"};
constexpr std::string_view kHeader =
    "camera,device_time_ns,edge_monotonic_ns,edge,image_index,xxh3";

std::vector<std::string_view> split(std::string_view line) {
  std::vector<std::string_view> fields;
  for (size_t comma = line.find(','); comma != line.npos; comma = line.find(',')) {
    fields.push_back(line.substr(0, comma));
    line.remove_prefix(comma + 1);
  }
  fields.push_back(line);
  return fields;
}

ExposureLine parse_line(std::string_view text, const std::string& where) {
  const auto fields = split(text);
  if (fields.size() != kColumns.size()) {
    throw InputError(where + ": " + std::to_string(fields.size()) + " fields, expected " +
                     std::string(kHeader));
  }
  const auto read = [&]<class T>(size_t column, T value, int base) {
    const std::string_view field = fields[column];
    const auto [end, error] =
        std::from_chars(field.data(), field.data() + field.size(), value, base);
    if (error != std::errc{} || end != field.data() + field.size()) {
      throw InputError(where + ": " + std::string(kColumns[column]) + ": \"" + std::string(field) +
                       "\" is not a number");
    }
    return value;
  };
  const auto number = [&](size_t column) { return read(column, int64_t{0}, 10); };
  return {std::string(fields[0]),
          from_ns<DeviceClock>(number(1)),
          from_ns<Monotonic>(number(2)),
          number(3),
          number(4),
          read(5, uint64_t{0}, 16)};
}

}  // namespace

ExposureRecord::ExposureRecord(const std::filesystem::path& path)
    : file_(std::fopen(path.c_str(), "w"), &std::fclose) {
  if (file_ == nullptr || std::fprintf(file_.get(), "%s\n", std::string(kHeader).c_str()) < 0 ||
      std::fflush(file_.get()) != 0) {
    throw InputError(errno_message(path.string()));
  }
}

void ExposureRecord::add(const ExposureLine& line) {
  const std::lock_guard lock(mutex_);
  const int written = std::fprintf(
      file_.get(), "%s,%" PRId64 ",%" PRId64 ",%" PRId64 ",%" PRId64 ",%016" PRIx64 "\n",
      line.camera.c_str(), to_ns(line.device_time), to_ns(line.edge_time), line.edge,
      line.image_index, line.checksum);
  if (written < 0 || std::fflush(file_.get()) != 0) {
    ++lost_;
  }
}

int64_t ExposureRecord::lost() const {
  const std::lock_guard lock(mutex_);
  return lost_;
}

std::vector<ExposureLine> parse_exposures(std::string_view text,
                                          const std::filesystem::path& path) {
  const auto next_line = [&text] {
    const size_t end = std::min(text.find('\n'), text.size());
    const std::string_view line = text.substr(0, end);
    text.remove_prefix(std::min(end + 1, text.size()));
    return line;
  };
  if (next_line() != kHeader) {
    throw InputError(path.string() + ":1: expected the line " + std::string(kHeader));
  }
  std::vector<ExposureLine> lines;
  for (int number = 2; !text.empty(); ++number) {
    lines.push_back(parse_line(next_line(), path.string() + ":" + std::to_string(number)));
  }
  return lines;
}

std::vector<ExposureLine> load_exposures(const std::filesystem::path& path) {
  return parse_exposures(read_file(path), path);
}

}  // namespace v3d::sim
