// Invariants of a daemon with a fault (injected_studio.h).
#pragma once

#include <string>
#include <vector>

#include "faulty_program.h"
#include "injected_studio.h"

namespace v3d::test {

/// Checks a run with `fault`, which was injected. Returns the broken invariants, one line each:
/// - the daemon ends without a signal, when it is asked to; at its start, it may end with an error;
/// - every frame and mesh that health, replies and ledger reported as written can be read;
/// - take.toml is not "complete" when a sync of a log failed, and ledgers list what is missing;
/// - a line of log, replies or events has path and cause, unless the run is as without the fault.
/// Recovers the take when it is still open.
std::vector<std::string> violations_of(const InjectedStudio& studio, const DaemonRun& run,
                                       const Fault& fault);

}  // namespace v3d::test
