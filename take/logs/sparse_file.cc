#include "take/logs/sparse_file.h"

#include <unistd.h>

#include <cerrno>

namespace v3d {

uint64_t next_data(const io::File& file, uint64_t offset) {
  const off_t data = lseek(file.fd(), static_cast<off_t>(offset), SEEK_DATA);
  if (data >= 0) return static_cast<uint64_t>(data);
  if (errno != ENXIO) return offset;
  return file.size().value_or(offset);
}

}  // namespace v3d
