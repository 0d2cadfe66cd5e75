#include "base/io/disk_error.h"

#include <cerrno>
#include <stdexcept>

#include "base/core/error.h"

namespace v3d::io {

void throw_creation_error(const IoError& error) {
  const bool is_of_disk = error.code == ENOSPC || error.code == EDQUOT || error.code == EIO;
  if (is_of_disk) throw std::runtime_error(error.message);
  throw InputError(error.message);
}

}  // namespace v3d::io
