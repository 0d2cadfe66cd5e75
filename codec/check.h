// V3D_CODEC_CHECK: assertions that stay active in every build. The codec uses only the standard
// library, so it has its own.
#pragma once

#include <cstdio>
#include <cstdlib>

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

}  // namespace v3d::codec
