#include "v3dctl/takes/rsync_output.h"

#include <sstream>
#include <string_view>

#include "base/io/file.h"
#include "take/take_files.h"

namespace v3d::ctl {

std::optional<ListedEntry> parse_entry(const std::string& line) {
  size_t end = 0;
  for (int column = 0; column < 4; ++column) {  // permissions, bytes, date, time
    end = line.find(' ', line.find_first_not_of(' ', end));
    if (end == std::string::npos) return std::nullopt;
  }
  return ListedEntry{line.front(), line.substr(end + 1)};
}

std::vector<std::string> absent_files(const std::string& itemized) {
  constexpr std::string_view kMark = "*deleting ";
  std::vector<std::string> files;
  std::istringstream lines(itemized);
  for (std::string line; std::getline(lines, line);) {
    if (!line.starts_with(kMark)) continue;
    std::string name = line.substr(line.find_first_not_of(' ', kMark.size()));
    const bool is_of_take = take::is_part_of_take(name) || take::is_written_after_ledger(name);
    const bool is_folder = name.ends_with('/');
    if (is_of_take && !is_folder && !io::is_temporary(name)) files.push_back(std::move(name));
  }
  return files;
}

int64_t total_bytes(const std::string& output) {
  constexpr std::string_view kLabel = "Total file size: ";
  const size_t found = output.find(kLabel);
  int64_t bytes = 0;
  if (found == std::string::npos) return bytes;
  for (const char c : std::string_view(output).substr(found + kLabel.size())) {
    if (c == ' ') break;
    if (c >= '0' && c <= '9') bytes = bytes * 10 + (c - '0');
  }
  return bytes;
}

}  // namespace v3d::ctl
