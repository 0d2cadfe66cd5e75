#include "fault_trace.h"

#include <cstring>

#include "base/io/file.h"

namespace v3d::test {

std::vector<TracedChange> read_trace(const std::filesystem::path& file) {
  const std::string text = read_file(file);
  std::vector<TracedChange> changes;
  ChangeHead head;
  for (size_t at = 0; at + sizeof head <= text.size();) {
    std::memcpy(&head, text.data() + at, sizeof head);
    at += sizeof head;
    if (at + head.path_size + head.other_size + head.bytes_size > text.size()) break;
    TracedChange change{
        .change = head.change,
        .file = head.file,
        .offset = head.offset,
        .path = text.substr(at, head.path_size),
        .other = text.substr(at + head.path_size, head.other_size),
        .bytes = text.substr(at + head.path_size + head.other_size, head.bytes_size)};
    at += head.path_size + head.other_size + head.bytes_size;
    changes.push_back(std::move(change));
  }
  return changes;
}

}  // namespace v3d::test
