#include "base/core/error.h"

#include <cerrno>
#include <system_error>

namespace v3d {

std::string errno_message(const std::string& what) {
  return what + ": " + std::generic_category().message(errno);
}

}  // namespace v3d
