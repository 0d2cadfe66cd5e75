// Compares the firmware of the cameras of a studio.
#pragma once

#include <map>
#include <string>

#include "wire/messages.h"

namespace v3d::control {

/// Names of texts in health, after the name of the camera and a dot.
inline constexpr char kCameraModel[] = "model";
inline constexpr char kCameraFirmware[] = "firmware";

/// One line that names the cameras of each model with more than one firmware: "Maker Model:
/// firmware 1.1 on cam02, 1.2 on cam01 and cam03". Empty when each model has one firmware.
/// `health`: the last message of each node. Cameras without a firmware in it are ignored.
std::string firmware_differences(const std::map<std::string, wire::HealthMessage>& health);

}  // namespace v3d::control
