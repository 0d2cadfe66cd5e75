// Checks for bugs that stay on in every build: see base/core/error.h for the kinds of error.
#pragma once

#include <cassert>

/// Aborts with "FILE:LINE: check failed: CONDITION" on stderr unless the condition holds. For
/// preconditions and invariants, which only a bug can violate; never for input. Text may be added
/// with &&: V3D_CHECK(output_ && "arm() comes first").
#define V3D_CHECK(condition) \
  ((condition) ? static_cast<void>(0) : ::v3d::check_failed(#condition, __FILE__, __LINE__))

/// The same in debug builds only, for what runs so often that a branch costs: the inner loops of
/// kernels.
#define V3D_DEBUG_CHECK(condition) assert(condition)

namespace v3d {

[[noreturn, gnu::cold]] void check_failed(const char* condition, const char* file,
                                          int line) noexcept;

}  // namespace v3d
