#include "take/logs/repaired_pulses.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <span>

#include "base/core/error.h"
#include "take/take_files.h"

namespace v3d::take {
namespace {

constexpr std::string_view kPrefix = "repaired.";
constexpr std::string_view kSuffix = ".txt";
/// One number of up to eight digits for each pulse of the longest take.
constexpr uint64_t kMaxBytes = 9 * kMaxPulses;

io::Result<io::File> open_to_append(const std::filesystem::path& path) {
  const auto type = io::type_of(path);
  if (!type) return tl::make_unexpected(type.error());
  const bool exists = *type != std::filesystem::file_type::not_found;
  return io::File::open(path, exists ? io::OpenMode::kWriteExisting : io::OpenMode::kCreate);
}

int64_t parse_pulse(std::string_view line, const std::filesystem::path& path, int64_t number) {
  int64_t pulse = -1;
  const auto parsed = std::from_chars(line.data(), line.data() + line.size(), pulse);
  if (parsed.ec != std::errc() || parsed.ptr != line.data() + line.size() || pulse < 0 ||
      pulse >= kMaxPulses) {
    throw InputError(path.string() + ":" + std::to_string(number) +
                     ": expected the number of a pulse, found '" + std::string(line.substr(0, 40)) +
                     "'");
  }
  return pulse;
}

void add_pulses(const std::filesystem::path& path, std::vector<int64_t>& pulses) {
  const std::string text =
      io::value_or_throw(io::read_file(path, kMaxBytes, io::OpenMode::kReadWithinFolder));
  int64_t number = 0;
  for (size_t begin = 0, end; (end = text.find('\n', begin)) != std::string::npos;
       begin = end + 1) {
    ++number;
    const std::string_view line = std::string_view(text).substr(begin, end - begin);
    if (!line.ends_with('-')) pulses.push_back(parse_pulse(line, path, number));
  }
}

}  // namespace

std::filesystem::path repaired_pulses_path(const TakePaths& paths, const std::string& node) {
  return paths.folder / (std::string(kPrefix) + node + std::string(kSuffix));
}

bool is_repaired_pulses(std::string_view name) {
  return name.starts_with(kPrefix) && name.ends_with(kSuffix) &&
         name.size() > kPrefix.size() + kSuffix.size();
}

/// Opens the file; ends a line that a crash has cut.
io::Status RepairedPulsesWriter::open() {
  auto file = open_to_append(path_);
  if (!file) return tl::make_unexpected(file.error());
  const auto size = file->size();
  if (!size) return tl::make_unexpected(size.error());
  file_ = *std::move(file);
  end_ = *size;
  std::array<uint8_t, 1> last = {'\n'};
  if (end_ > 0) {
    if (auto read = file_->read_whole(end_ - 1, last); !read) return read;
  }
  return last[0] == '\n' ? io::Status() : append("-\n");
}

io::Status RepairedPulsesWriter::append(const std::string& text) {
  const std::span bytes(reinterpret_cast<const uint8_t*>(text.data()), text.size());
  if (auto written = file_->write(end_, {bytes}); !written) return written;
  end_ += text.size();
  return {};
}

io::Status RepairedPulsesWriter::add(int64_t pulse) {
  if (!file_) {
    if (auto opened = open(); !opened) {
      file_.reset();
      return opened;
    }
  }
  return append(std::to_string(pulse) + "\n");
}

std::vector<int64_t> read_repaired_pulses(const TakePaths& paths) {
  std::vector<int64_t> pulses;
  for (const std::string& name : io::value_or_throw(take_file_names(paths))) {
    if (is_repaired_pulses(name)) add_pulses(paths.folder / name, pulses);
  }
  std::ranges::sort(pulses);
  pulses.erase(std::unique(pulses.begin(), pulses.end()), pulses.end());
  return pulses;
}

}  // namespace v3d::take
