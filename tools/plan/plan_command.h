// The command `v3dctl plan`.
#pragma once

#include "v3dctl/command_line.h"

namespace v3d::plan {

/// Adds `plan`.
void add_plan(ctl::CommandLine& line);

}  // namespace v3d::plan
