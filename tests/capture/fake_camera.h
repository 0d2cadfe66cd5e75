// Test fixture: the fake camera of Aravis at 127.0.0.11, and settings to open it.
#pragma once

#include <arv.h>

#include <fstream>
#include <memory>
#include <string>

#include "base/core/error.h"
#include "capture/cameras/aravis_camera.h"
#include "sim/cameras/gige_cameras.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"

namespace v3d::capture {

struct Unref {
  void operator()(gpointer object) const { g_object_unref(object); }
};

/// Simulated camera at 127.0.0.11. Its software-trigger register triggers it.
class FakeCamera {
 public:
  /// `description`: a GenICam file; null: that of Aravis.
  explicit FakeCamera(const char* description = nullptr)
      : camera_(arv_gv_fake_camera_new_full("127.0.0.11", "V3D-0001", description)) {
    // Rate at which it polls the trigger register, Hz.
    if (!running()) return;
    arv_fake_camera_set_trigger_frequency(device(), 400);
    // The description of the simulator has another register for the trigger source.
    if (description != nullptr) write(ARV_FAKE_CAMERA_REGISTER_TRIGGER_SOURCE, 1);
  }

  bool running() const { return arv_gv_fake_camera_is_running(camera_.get()); }
  ArvFakeCamera* device() const { return arv_gv_fake_camera_get_fake_camera(camera_.get()); }
  uint32_t read(uint32_t address) const {
    uint32_t value = 0;
    arv_fake_camera_read_register(device(), address, &value);
    return value;
  }
  void write(uint32_t address, uint32_t value) const {
    arv_fake_camera_write_register(device(), address, value);
  }
  void trigger() const { write(ARV_FAKE_CAMERA_REGISTER_TRIGGER_SOFTWARE, 1); }
  void unplug() { camera_.reset(); }

 private:
  std::unique_ptr<ArvGvFakeCamera, Unref> camera_;
};

inline StudioCamera settings() {
  StudioCamera camera;
  camera.name = "cam07";
  camera.address = "127.0.0.11";
  camera.pixel_format = PixelFormat::kMono8;
  camera.exposure_us = 2500;
  camera.gain_db = 3;
  camera.trigger_line = "Software";
  camera.packet_size = 8000;
  return camera;
}

/// The message with which the camera rejects the settings.
inline std::string start_error(const StudioCamera& wanted) {
  AravisCamera camera(wanted);
  return test::message_of<InputError>([&] { camera.start(); });
}

/// A simulated camera with the GenICam description of the simulator.
struct SimulatedCamera {
  static StudioCamera settings() {
    StudioCamera wanted = v3d::capture::settings();
    wanted.trigger_line = "Line1";
    return wanted;
  }

  static std::string description(const std::filesystem::path& path) {
    std::ofstream(path) << sim::genicam_xml();
    return path;
  }
  const test::TemporaryFolder folder;
  const FakeCamera fake{description(folder / "genicam.xml").c_str()};
};

}  // namespace v3d::capture
