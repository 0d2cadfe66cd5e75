// What is weak in a calibration, and what to record to mend it.
#pragma once

#include <string>
#include <vector>

#include "calib/rig/rig_fit.h"

namespace v3d::calib {

/// Sentences, the gravest first; empty where nothing is weak. Judged are: shared views with the
/// neighbours, how much of the image boards reached and where they did not, cameras that fit worse
/// than the others, pictures left out, lateness.
std::vector<std::string> advice(const RigFit& fit);

}  // namespace v3d::calib
