// Sets the wall clock of capture nodes in a scenario test.
#pragma once

#include <cstdlib>
#include <filesystem>
#include <string>

#include "support/temporary_folder.h"

namespace v3d::test {

/// Sets the environment that preloads v3d_set_clock into daemons started during its lifetime.
struct SetClockPreloaded {
  SetClockPreloaded() {
    setenv("LD_PRELOAD", V3D_SET_CLOCK_LIBRARY, 1);
    setenv("V3D_SET_CLOCK", control().c_str(), 1);
    setenv("V3D_SET_CLOCK_OF", "v3d-captured", 1);
  }
  ~SetClockPreloaded() {
    for (const char* name : {"LD_PRELOAD", "V3D_SET_CLOCK", "V3D_SET_CLOCK_OF"}) unsetenv(name);
  }
  std::filesystem::path control() const { return folder_ / "seconds"; }

  /// Sets the wall clock of the capture nodes to `seconds` after the right time.
  void set_clock(int seconds) const { write_text(control(), std::to_string(seconds)); }

 private:
  const TemporaryFolder folder_;
};

}  // namespace v3d::test
