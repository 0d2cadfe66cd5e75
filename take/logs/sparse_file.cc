#include "take/logs/sparse_file.h"

#include <unistd.h>

#include <algorithm>
#include <cerrno>

#include "base/core/units.h"

namespace v3d {

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

}  // namespace v3d
