#include "daemon/control/camera_firmware.h"

#include <gtest/gtest.h>

namespace v3d::control {
namespace {

wire::HealthMessage node_with(std::map<std::string, std::string> texts) {
  wire::HealthMessage health;
  health.texts = std::move(texts);
  return health;
}

TEST(CameraFirmware, that_differs_within_a_model_is_listed_with_its_cameras) {
  const std::map<std::string, wire::HealthMessage> health = {
      {"cap01", node_with({{"cam01.model", "Maker A"},
                           {"cam01.firmware", "1.2"},
                           {"cam02.model", "Maker A"},
                           {"cam02.firmware", "1.1"}})},
      {"cap02", node_with({{"cam.03.model", "Maker A"},
                           {"cam.03.firmware", "1.2"},
                           {"cam04.model", "Maker B"},
                           {"cam04.firmware", "7"}})}};
  EXPECT_EQ(firmware_differences(health), "Maker A: firmware 1.1 on cam02, 1.2 on cam01, cam.03");
}

TEST(CameraFirmware, may_differ_between_models_and_may_be_unknown) {
  const std::map<std::string, wire::HealthMessage> health = {
      {"cap01", node_with({{"cam01.model", "Maker A"},
                           {"cam01.firmware", "1.2"},
                           {"cam02.model", "Maker A"},
                           {"cam03.firmware", "1.1"}})},
      {"cap02", node_with({{"cam04.model", "Maker B"}, {"cam04.firmware", "7"}})},
      {"recon01", node_with({})}};
  EXPECT_EQ(firmware_differences(health), "");
}

}  // namespace
}  // namespace v3d::control
