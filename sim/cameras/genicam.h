// The GenICam description of the simulated cameras, over the register map of Aravis' fake camera
// (arvfakecamera.h).
#pragma once

#include <string>

namespace v3d::sim {

/// XML of the GenApi schema 1.1, with feature names of the SFNC.
std::string genicam_xml();

}  // namespace v3d::sim
