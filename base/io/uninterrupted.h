// uninterrupted: tries a system call again when a signal interrupted it.
#pragma once

#include <cerrno>
#include <system_error>

namespace v3d::io {

/// What `call` returns when it succeeds, or fails with another errno than EINTR. `call` returns a
/// negative value where it fails.
template <class Call>
auto uninterrupted(Call call) {
  auto result = call();
  while (result < 0 && errno == EINTR) result = call();
  return result;
}

/// The same for a call that sets an std::error_code. Returns the code.
template <class Call>
std::error_code uninterrupted_code(Call call) {
  std::error_code code;
  do {
    code.clear();
    call(code);
  } while (code == std::errc::interrupted);
  return code;
}

}  // namespace v3d::io
