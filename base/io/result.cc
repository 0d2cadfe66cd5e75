#include "base/io/result.h"

#include <cstring>

#include "base/core/error.h"

namespace v3d::io {

tl::unexpected<IoError> io_error(std::string_view action, const std::filesystem::path& path) {
  const int code = errno;
  return io_error(action, path, strerrordesc_np(code) ? strerrordesc_np(code) : "unknown error",
                  code);
}

tl::unexpected<IoError> io_error(std::string_view action, const std::filesystem::path& path,
                                 std::string_view cause, int code) {
  return tl::make_unexpected(IoError{
      code, "cannot " + std::string(action) + " " + path.string() + ": " + std::string(cause)});
}

void throw_input_error(const IoError& error) { throw InputError(error.message); }

void throw_if_failed(const Status& status) {
  if (!status) throw std::runtime_error(status.error().message);
}

}  // namespace v3d::io
