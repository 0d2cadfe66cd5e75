#include "calib/formats/text_fields.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <optional>
#include <vector>

#include "base/core/error.h"
#include "base/core/text.h"

namespace v3d::calib {
namespace {

constexpr std::string_view kBlanks = " \t\r";

}  // namespace

TextLine::TextLine(std::string_view text, std::string path, int number)
    : left_(text), path_(std::move(path)), number_(number) {
  skip_blanks();
}

void TextLine::skip_blanks() {
  left_.remove_prefix(std::min(left_.find_first_not_of(kBlanks), left_.size()));
}

int TextLine::count_words() const {
  TextLine copy = *this;
  int count = 0;
  for (; !copy.done(); ++count) copy.word("");
  return count;
}

std::string_view TextLine::word(std::string_view what) {
  if (done()) fail(std::string(what) + ": missing");
  const std::string_view found = left_.substr(0, left_.find_first_of(kBlanks));
  left_.remove_prefix(found.size());
  skip_blanks();
  return found;
}

double TextLine::real(std::string_view what) {
  const std::string_view found = word(what);
  const std::string_view digits = found.substr(found.starts_with('+') ? 1 : 0);
  double value = 0;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
  const bool whole = error == std::errc() && end == digits.data() + digits.size();
  if (!whole || !std::isfinite(value)) {
    fail(std::string(what) + ": expected a finite number, found '" + printable(found) + "'");
  }
  return value;
}

int64_t TextLine::whole(std::string_view what) {
  const std::string_view found = word(what);
  int64_t value = 0;
  const auto [end, error] = std::from_chars(found.data(), found.data() + found.size(), value);
  if (error != std::errc() || end != found.data() + found.size()) {
    fail(std::string(what) + ": expected a whole number, found '" + printable(found) + "'");
  }
  return value;
}

Eigen::Vector3d TextLine::vector(std::string_view what) {
  Eigen::Vector3d v;
  for (int i = 0; i < 3; ++i) v[i] = real(what);
  return v;
}

Eigen::Matrix3d TextLine::matrix(std::string_view what) {
  Eigen::Matrix3d m;
  for (int row = 0; row < 3; ++row) m.row(row) = vector(what).transpose();
  return m;
}

std::string_view TextLine::remaining(std::string_view what) {
  if (done()) fail(std::string(what) + ": missing");
  std::string_view found = left_;
  found.remove_suffix(found.size() - 1 - found.find_last_not_of(kBlanks));
  left_ = {};
  return found;
}

void TextLine::fail(const std::string& message) const {
  throw InputError(path_ + ":" + std::to_string(number_) + ": " + message);
}

std::vector<TextLine> split_lines(std::string_view text, const std::filesystem::path& path) {
  std::vector<TextLine> lines;
  while (!text.empty()) {
    const size_t end = std::min(text.find('\n'), text.size());
    lines.emplace_back(text.substr(0, end), path.string(), static_cast<int>(lines.size()) + 1);
    text.remove_prefix(std::min(end + 1, text.size()));
  }
  return lines;
}

std::string number_text(double value) {
  std::array<char, 40> text{};
  return {text.data(), std::to_chars(text.data(), text.data() + text.size(), value).ptr};
}

std::string numbers_text(const Eigen::Ref<const Eigen::VectorXd>& values) {
  std::string text;
  for (const double value : values) text += " " + number_text(value);
  return text;
}

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

/// Whether frame indices (with their instants) are not counted from the first frame of a video of
/// `frames` frames. A video without its last frames has indices beyond its end, too, but few.
bool has_other_origin(const std::map<int64_t, int64_t>& by_index, int64_t frames) {
  constexpr int64_t kMaxLostShare = 100;  // a hundredth of the frames
  const int64_t first = by_index.begin()->first, last = by_index.rbegin()->first;
  const int64_t beyond = last - frames + 1;
  if (frames <= 0 || beyond <= 0) return false;
  const bool has_length_of_video = last - first + 1 == frames;
  return has_length_of_video || beyond > std::max<int64_t>(2, frames / kMaxLostShare);
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

FrameInstants frame_instants(const TimeStamps& stamps, const std::string& camera, int64_t frames,
                             const std::filesystem::path& path) {
  auto found = stamps.find(camera);
  if (found == stamps.end()) found = stamps.find(id_of(camera));
  if (found == stamps.end() || found->second.empty()) {
    throw InputError(path.string() + ": no time stamps of camera " + camera);
  }
  const int64_t first = has_other_origin(found->second, frames) ? found->second.begin()->first : 0;
  FrameInstants result;
  for (const auto& [index, instant] : found->second) {
    const int64_t frame = index - first;
    if (frames > 0 && frame >= frames) {
      ++result.beyond;
    } else {
      result.instants[frame] = instant;
    }
  }
  return result;
}

}  // namespace v3d::calib
