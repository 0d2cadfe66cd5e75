#include "cli/standard_output.h"

#include <cerrno>
#include <cstdio>
#include <string>

#include "base/core/error.h"

namespace v3d::cli {
namespace {

/// The error of writing standard output; 0: all of it is written.
int output_error() {
  if (std::fflush(stdout) != 0) return errno;
  if (std::ferror(stdout) == 0) return 0;
  // An earlier write has failed, and stdio does not keep its errno. Ending the line fails likewise.
  const bool is_written = std::fputc('\n', stdout) != EOF && std::fflush(stdout) == 0;
  return is_written ? EIO : errno;
}

}  // namespace

int finish_standard_output(std::string_view program, int status) {
  errno = output_error();
  if (errno == 0 || errno == EPIPE) return status;
  const std::string message =
      errno_message(std::string(program) + ": cannot write standard output");
  std::fprintf(stderr, "%s\n", message.c_str());
  return status == kExitDone ? kExitFailed : status;
}

}  // namespace v3d::cli
