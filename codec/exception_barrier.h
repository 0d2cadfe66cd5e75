// Exception barrier of the C interface: converts std::bad_alloc to an error value.
#pragma once

#include <exception>

namespace v3d::codec {

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
