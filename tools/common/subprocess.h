// Another program, run to its end.
#pragma once

#include <string>
#include <vector>

namespace v3d {

struct ProcessResult {
  int status = 0;      ///< exit status; 128 + signal when one ended it
  std::string output;  ///< what it wrote to its standard output, when that was captured
  std::string errors;  ///< the same of its standard error
};

/// Its standard output, which is captured or shown on our standard error: ours is for results. Its
/// standard error is ours, unless both are captured.
enum class Output { kCapture, kShow, kCaptureBoth };

/// `words`: the program, found on the PATH, and its arguments; it has nothing to read. Throws
/// InputError when there is no such program.
ProcessResult run_process(const std::vector<std::string>& words, Output output);

/// Whether the PATH has such a program.
bool has_program(const std::string& name);

}  // namespace v3d
