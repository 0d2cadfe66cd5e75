// Health for Prometheus, over HTTP. The adapter of prometheus-cpp.
#pragma once

#include <memory>
#include <string>

#include "wire/messages.h"

namespace v3d {

/// Serves the last health at http://ADDRESS/metrics: every value as v3d_NAME with the labels `node`
/// and, for a camera's, `camera`; and v3d_info with state, take, program and version. Answers in 32
/// threads of its own; a client has 1 s for its whole request, so that slow ones keep no scraper
/// from its answer.
class MetricsServer {
 public:
  /// `address`: "127.0.0.1:9464". Throws InputError when nothing can listen there.
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

/// Null where `address` is empty, and, with a warning in the log, where nothing can listen there:
/// the studio does not wait for who only watches it.
std::unique_ptr<MetricsServer> serve_metrics(const std::string& address);

}  // namespace v3d
