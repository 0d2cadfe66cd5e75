// The numbers of the deformation on the command line.
#pragma once

#include <string_view>

#include "recon/deform.h"

namespace v3d::ctl {

/// "mode=paper,internal=0.3,photometric=0.4,silhouette=0.3,window=7,views=6": any of these, in any
/// order; "" gives the defaults. Throws InputError for anything else and for what check() refuses.
DeformOptions parse_deform(std::string_view text);

}  // namespace v3d::ctl
