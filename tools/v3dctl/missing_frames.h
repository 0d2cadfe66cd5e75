// The message of commands that read all cameras of a take, where some frames are missing or
// damaged.
#pragma once

#include <cstdint>
#include <filesystem>

#include "common/console.h"
#include "v3dctl/command_line.h"
#include "v3dctl/options.h"

namespace v3d::ctl {

/// Reports `frames` that a camera has not or that cannot be read, one line on stderr. Returns the
/// exit status: kExitDone where there are none, else kExitNotWhole.
inline int note_missing(int64_t frames, const std::filesystem::path& take) {
  if (frames == 0) return kExitDone;
  note("v3dctl: a camera is missing in " + count_of(frames, "frame") + ": see v3dctl verify " +
       take.string());
  return kExitNotWhole;
}

}  // namespace v3d::ctl
