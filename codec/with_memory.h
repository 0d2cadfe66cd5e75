// Calls of C programs into the codec when memory is exhausted.
#pragma once

#include <exception>

namespace v3d::codec {

/// Returns the result of `call`, or `otherwise` when memory is exhausted. Without exceptions, as in
/// WebAssembly, the program is aborted instead.
template <class Call, class Result>
Result with_memory(const Call& call, Result otherwise) {
#ifdef __cpp_exceptions
  try {
    return call();
  } catch (const std::exception&) {
    return otherwise;
  }
#else
  static_cast<void>(otherwise);
  return call();
#endif
}

}  // namespace v3d::codec
