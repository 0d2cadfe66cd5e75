// Result of an operation that may fail while the program runs: a value or an IoError.
//
// Set-up code converts an IoError to an exception (value_or_throw, throw_if_failed); daemons handle
// it as data.
#pragma once

#include <cerrno>
#include <filesystem>
#include <string>
#include <string_view>
#include <tl/expected.hpp>
#include <utility>

namespace v3d::io {

/// Cause of a failed operation.
struct IoError {
  int code = 0;  ///< errno
  /// One line with path and cause: "cannot write /a/b: No space left on device".
  std::string message;
};

template <class T>
using Result = tl::expected<T, IoError>;
using Status = Result<void>;

/// The error of the last failed system call: "cannot `action` `path`: <text of errno>".
/// Reads errno, so call it directly after the failure.
tl::unexpected<IoError> io_error(std::string_view action, const std::filesystem::path& path);
/// The same for a failure without errno: "cannot `action` `path`: `cause`".
tl::unexpected<IoError> io_error(std::string_view action, const std::filesystem::path& path,
                                 std::string_view cause, int code = EINVAL);

/// For set-up that reads: throws InputError (exit status 2) with the message.
[[noreturn]] void throw_input_error(const IoError& error);
template <class T>
T value_or_throw(Result<T> result) {
  if (!result) throw_input_error(result.error());
  return *std::move(result);
}

/// For commands that write: throws std::runtime_error (exit status 1) with the message.
void throw_if_failed(const Status& status);

}  // namespace v3d::io
