// Serves the health of a node to Prometheus over HTTP. Adapter of prometheus-cpp.
#pragma once

#include <memory>
#include <string>

#include "wire/messages.h"

namespace v3d {

/// Serves the last health message at http://ADDRESS/metrics. Every value is a gauge v3d_NAME with
/// the label `node`; values of a camera are v3d_camera_NAME and have the label `camera`, too.
/// v3d_info has state, take, program and version as labels.
///
/// Has 32 threads. A client must send its request within 1 s, so that slow clients do not block
/// others.
class MetricsServer {
 public:
  /// `address`: "127.0.0.1:9464". Throws InputError when it cannot listen there.
  explicit MetricsServer(const std::string& address);
  ~MetricsServer();
  MetricsServer(const MetricsServer&) = delete;
  MetricsServer& operator=(const MetricsServer&) = delete;

  /// Any thread.
  void update(const HealthMessage& health);

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

/// Null where `address` is empty. Also null, with a warning in the log, when it cannot listen
/// there: recording does not depend on monitoring.
std::unique_ptr<MetricsServer> serve_metrics(const std::string& address);

}  // namespace v3d
