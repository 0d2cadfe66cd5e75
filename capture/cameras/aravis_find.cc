#include "capture/cameras/aravis_find.h"

#include <mutex>
#include <string>

#include "base/core/error.h"

namespace v3d::aravis {
namespace {

/// The list of devices is global in Aravis and is addressed by index.
std::mutex& device_list_mutex() {
  static std::mutex mutex;
  return mutex;
}

std::string device_with_serial(const std::string& serial) {
  for (unsigned i = 0; i < arv_get_n_devices(); ++i) {
    const char* found = arv_get_device_serial_nbr(i);
    if (found && serial == found) return arv_get_device_id(i);
  }
  return {};
}

std::string serials_found() {
  std::string list;
  for (unsigned i = 0; i < arv_get_n_devices(); ++i) {
    const char* serial = arv_get_device_serial_nbr(i);
    list += (list.empty() ? "" : ", ") + std::string(serial ? serial : "?");
  }
  return list.empty() ? "no camera" : list;
}

Owned<ArvCamera> open_by_address(const StudioCamera& settings) {
  Problem problem;
  Owned<ArvCamera> camera(arv_camera_new(settings.address.c_str(), problem));
  if (!camera || problem.happened()) {
    throw InputError("camera " + settings.name + ": no answer from " + settings.address + " (" +
                     problem.text() + ")");
  }
  return camera;
}

/// Searches the network only if the device list of the last search does not lead to the camera: a
/// search takes one second, and a node opens many cameras.
Owned<ArvCamera> open_by_serial(const StudioCamera& settings) {
  const std::lock_guard lock(device_list_mutex());
  std::string cause;
  for (const bool search : {false, true}) {
    if (search) arv_update_device_list();
    const std::string id = device_with_serial(settings.address);
    if (id.empty()) continue;
    Problem problem;
    Owned<ArvCamera> camera(arv_camera_new(id.c_str(), problem));
    if (camera && !problem.happened()) return camera;
    cause = problem.text();
  }
  throw InputError(
      "camera " + settings.name + ": " +
      (cause.empty()
           ? "no camera has the serial number '" + settings.address + "'; found: " + serials_found()
           : "found serial number " + settings.address + ", but cannot open it: " + cause));
}

}  // namespace

Owned<ArvCamera> open(const StudioCamera& settings) {
  const bool is_ip = g_hostname_is_ip_address(settings.address.c_str());
  return is_ip ? open_by_address(settings) : open_by_serial(settings);
}

}  // namespace v3d::aravis
