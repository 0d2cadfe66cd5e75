// V3D_CHECK: assertions that stay active in every build. See base/core/error.h for the kinds of
// error.
#pragma once

#include <cassert>

/// Aborts with "FILE:LINE: check failed: CONDITION" on stderr when the condition is false.
/// Use it for preconditions and invariants, which only a bug can violate; never for input. Append
/// text with &&: V3D_CHECK(output_ && "arm() comes first").
#define V3D_CHECK(condition) \
  ((condition) ? static_cast<void>(0) : ::v3d::check_failed(#condition, __FILE__, __LINE__))

/// Like V3D_CHECK, in debug builds only: for the inner loops of kernels, where a branch costs time.
#define V3D_DEBUG_CHECK(condition) assert(condition)

namespace v3d {

[[noreturn, gnu::cold]] void check_failed(const char* condition, const char* file,
                                          int line) noexcept;

}  // namespace v3d
