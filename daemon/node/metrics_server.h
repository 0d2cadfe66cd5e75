// Serves the health of a node to Prometheus over HTTP. prometheus-cpp makes the text.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "wire/messages.h"

namespace v3d::node {

/// Serves the last health message at http://ADDRESS/metrics. Every value is a gauge v3d_NAME with
/// the label `node`; values of a camera are v3d_camera_NAME and have the label `camera`, too.
/// v3d_info has state, take, program and version as labels.
///
/// Connections are bounded as those of v3d-viewd (ConnectionSlots): where their places are taken, a
/// new connection replaces the oldest one without a whole request. Each connection ends after one
/// response.
class MetricsServer {
 public:
  /// `address`: "127.0.0.1:9464"; port 0 selects a free port. No interface needs to have it yet.
  /// Throws InputError when the text is no address or the server may not listen there, and
  /// std::runtime_error while another program does.
  explicit MetricsServer(const std::string& address);
  ~MetricsServer();
  MetricsServer(const MetricsServer&) = delete;
  MetricsServer& operator=(const MetricsServer&) = delete;

  /// Any thread.
  void update(const wire::HealthMessage& health);
  uint16_t port() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

/// Null where `address` is empty. Also null, with a warning in the log, when it cannot listen
/// there: recording does not depend on monitoring.
std::unique_ptr<MetricsServer> serve_metrics(const std::string& address);

}  // namespace v3d::node
