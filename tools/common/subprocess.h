// Runs a program and waits for its end.
#pragma once

#include <string>
#include <vector>

namespace v3d {

/// Result of a finished program.
struct ProcessResult {
  int status = 0;      ///< exit status, or 128 + signal
  std::string output;  ///< standard output, if captured
  std::string errors;  ///< standard error, if captured
};

/// Output of the program. kCapture returns its standard output; kShow writes it to standard error
/// of this process, because standard output is reserved for results. kCaptureBoth returns standard
/// error, too.
enum class Output { kCapture, kShow, kCaptureBoth };

/// Runs the program with empty standard input. `words`: its name, searched in PATH, and its
/// arguments. Throws InputError when there is no such program.
ProcessResult run_process(const std::vector<std::string>& words, Output output);

/// True when PATH contains such a program.
bool has_program(const std::string& name);

}  // namespace v3d
