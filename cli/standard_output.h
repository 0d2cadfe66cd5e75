// Standard output at the end of a program: detects results that could not be written.
#pragma once

#include <string_view>

namespace v3d::cli {

/// Flushes standard output and returns the exit status of the program. Where the output could not
/// be written, prints "PROGRAM: cannot write standard output: REASON" on stderr and returns
/// kExitFailed in place of kExitDone; another `status` stays. A closed pipe is no error: its reader
/// does not need the rest. Call at the end of main().
int finish_standard_output(std::string_view program, int status);

}  // namespace v3d::cli
