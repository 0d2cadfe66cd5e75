// A camera's clock under PTP (IEEE 1588). For capture/aravis_*.cc only.
#pragma once

#include <arv.h>

#include <optional>
#include <string>

#include "base/core/time.h"

namespace v3d::aravis {

/// What the features of PTP are called: by the SFNC since version 2.2, and by cameras before.
struct PtpNames {
  const char* enable;
  const char* status;
  const char* latch;
  const char* offset;
};

/// Asks the camera each time; the camera must outlive it. One thread.
class Ptp {
 public:
  /// Empty where the camera has none.
  static std::optional<Ptp> of(ArvCamera* camera);

  const char* enable_feature() const { return names_.enable; }
  const char* status_feature() const { return names_.status; }
  /// "Slave", "Master", "Listening", ...
  std::string status() const;
  /// The master of the studio is in step with itself.
  bool in_step() const;
  /// Of the camera's clock from its master; empty while it is not in step.
  std::optional<Duration> offset() const;

 private:
  Ptp(ArvCamera* camera, const PtpNames& names) : camera_(camera), names_(names) {}

  ArvCamera* camera_;
  PtpNames names_;
};

}  // namespace v3d::aravis
