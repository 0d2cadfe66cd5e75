// Runs a command of v3dctl in the process of a test.
#pragma once

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "v3dctl/command_line.h"

namespace v3d::test {

struct CommandOutcome {
  int status = 0;
  std::string error;  ///< stderr
};

/// Runs `v3dctl WORDS`. `add`: adds the command.
inline CommandOutcome run_command(void (*add)(ctl::CommandLine&), std::vector<std::string> words) {
  words.insert(words.begin(), "v3dctl");
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  testing::internal::CaptureStderr();
  const int status = ctl::run_program(static_cast<int>(argv.size()), argv.data(), add);
  return {status, testing::internal::GetCapturedStderr()};
}

}  // namespace v3d::test
