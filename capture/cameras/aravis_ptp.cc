#include "capture/cameras/aravis_ptp.h"

#include "capture/cameras/aravis_object.h"

namespace v3d::aravis {
namespace {

constexpr PtpNames kNames[] = {
    {"PtpEnable", "PtpStatus", "PtpDataSetLatch", "PtpOffsetFromMaster"},
    {"GevIEEE1588", "GevIEEE1588Status", "GevIEEE1588DataSetLatch", "GevIEEE1588OffsetFromMaster"}};

}  // namespace

std::optional<Ptp> Ptp::of(ArvCamera* camera) {
  for (const PtpNames& names : kNames) {
    if (has_feature(camera, names.enable)) return Ptp(camera, names);
  }
  return {};
}

std::string Ptp::status() const {
  Problem problem;
  const char* status = arv_camera_get_string(camera_, names_.status, problem);
  return problem.happened() || !status ? "no answer" : status;
}

bool Ptp::is_synchronised() const {
  const std::string now = status();
  return now == "Slave" || now == "Master";
}

std::optional<Duration> Ptp::offset() const {
  Problem latched;
  arv_camera_execute_command(camera_, names_.latch, latched);
  Problem asked;
  const gint64 offset = arv_camera_get_integer(camera_, names_.offset, asked);
  return is_synchronised() && !asked.happened() ? std::optional(Duration(offset)) : std::nullopt;
}

}  // namespace v3d::aravis
