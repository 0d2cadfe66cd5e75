// PTP (IEEE 1588) state of a camera's clock. For capture/cameras/aravis_*.cc only.
#pragma once

#include <arv.h>

#include <optional>
#include <string>

#include "base/core/time.h"

namespace v3d::aravis {

/// GenICam names of the PTP features: SFNC 2.2 and later, or the older Gev names.
struct PtpNames {
  const char* enable;
  const char* status;
  const char* latch;
  const char* offset;
};

/// Every call queries the camera. The camera must outlive this object. Not thread-safe.
class Ptp {
 public:
  /// Empty if the camera has no PTP.
  static std::optional<Ptp> of(ArvCamera* camera);

  const char* enable_feature() const { return names_.enable; }
  const char* status_feature() const { return names_.status; }
  /// The state that the camera reports: "Slave", "Master", "Listening", ...; "no answer" on error.
  std::string status() const;
  /// The clock is a synchronised slave, or the master of the studio.
  bool is_synchronised() const;
  /// Offset of the camera's clock from its master. Empty while it is not synchronised.
  std::optional<Duration> offset() const;

 private:
  Ptp(ArvCamera* camera, const PtpNames& names) : camera_(camera), names_(names) {}

  ArvCamera* camera_;
  PtpNames names_;
};

}  // namespace v3d::aravis
