// uninterrupted: tries a system call again when a signal interrupted it.
#pragma once

#include <cerrno>

namespace v3d::io {

/// What `call` returns when it succeeds, or fails with another errno than EINTR. `call` returns a
/// negative value where it fails.
template <class Call>
auto uninterrupted(Call call) {
  auto result = call();
  while (result < 0 && errno == EINTR) result = call();
  return result;
}

}  // namespace v3d::io
