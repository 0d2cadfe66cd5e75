// The GenICam description of the simulated cameras, over the register map of Aravis' fake camera
// (arvfakecamera.h).
#pragma once

#include <string>

namespace v3d::sim {

/// XML after the GenApi schema 1.1, feature names after the SFNC.
std::string genicam_xml();

}  // namespace v3d::sim
