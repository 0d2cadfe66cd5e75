// Repeats a system call that a signal interrupted (EINTR).
#pragma once

#include <cerrno>
#include <system_error>

namespace v3d::io {

/// Repeats `call` until it returns another result than EINTR, and returns that result. `call`
/// returns a negative value and sets errno when it fails.
template <class Call>
auto uninterrupted(Call call) {
  auto result = call();
  while (result < 0 && errno == EINTR) result = call();
  return result;
}

/// Like uninterrupted(), for a call that sets an std::error_code. Returns the code.
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
