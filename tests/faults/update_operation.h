// Update of an appliance, for power cuts.
#pragma once

#include "fault_operations.h"

namespace v3d::test {

/// The operation "update": the bundle and the request are copied as v3dctl does, and the
/// appliance's install-update installs it with a stand-in for RAUC. check() starts the PC and lets
/// it finish, and then repeats the update.
FaultOperation update_operation();

}  // namespace v3d::test
