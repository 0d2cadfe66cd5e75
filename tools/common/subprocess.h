// Another program, run to its end.
#pragma once

#include <string>
#include <vector>

namespace v3d {

struct ProcessResult {
  int status = 0;      ///< exit status; 128 + signal when one ended it
  std::string output;  ///< what it wrote to its standard output, when that was captured
};

/// Its standard output, which is captured or shown on our standard error: ours is for results.
enum class Output { kCapture, kShow };

/// `words`: the program, found on the PATH, and its arguments. Its standard error is ours. Throws
/// InputError when there is no such program.
ProcessResult run_process(const std::vector<std::string>& words, Output output);

}  // namespace v3d
