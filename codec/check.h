// Failures of the codec: assertions that stay active in every build (V3D_CODEC_CHECK), and
// exhausted memory. The codec uses only the standard library, so it has its own assertions.
#pragma once

#include <cstdio>
#include <cstdlib>
#include <exception>

/// Aborts with "FILE:LINE: check failed: CONDITION" on stderr when the condition is false; the
/// WebAssembly module, which has no stderr, traps. Use it for preconditions and invariants, which
/// only a bug can violate; never for bytes from outside.
#define V3D_CODEC_CHECK(condition)    \
  ((condition) ? static_cast<void>(0) \
               : ::v3d::codec::codec_check_failed(#condition, __FILE__, __LINE__))

namespace v3d::codec {

[[noreturn, gnu::cold, gnu::noinline]] inline void codec_check_failed(
    [[maybe_unused]] const char* condition, [[maybe_unused]] const char* file,
    [[maybe_unused]] int line) noexcept {
#ifdef __wasm__
  __builtin_trap();
#else
  std::fprintf(stderr, "%s:%d: check failed: %s\n", file, line, condition);
  std::abort();
#endif
}

// Exception barrier of the C interface: converts std::bad_alloc to an error value.

/// Returns the result of `call`, or `error` when memory is exhausted. Without exceptions, as in
/// WebAssembly, the program is aborted instead.
template <class Call, class Result>
Result value_or_on_bad_alloc(const Call& call, Result error) {
#ifdef __cpp_exceptions
  try {
    return call();
  } catch (const std::exception&) {
    return error;
  }
#else
  static_cast<void>(error);
  return call();
#endif
}

}  // namespace v3d::codec
