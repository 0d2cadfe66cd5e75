#include "daemon/node/metrics_server.h"

#include <prometheus/collectable.h>
#include <prometheus/exposer.h>
#include <prometheus/metric_family.h>
#include <spdlog/spdlog.h>

#include <cctype>
#include <map>
#include <mutex>
#include <vector>

#include "base/core/error.h"

namespace v3d {
namespace {

using prometheus::ClientMetric;
using prometheus::MetricFamily;

/// Metric names may have letters, digits and underscores only.
std::string metric_name(const std::string& value_name) {
  std::string name = "v3d_" + value_name;
  for (char& c : name) {
    if (!std::isalnum(static_cast<unsigned char>(c))) c = '_';
  }
  return name;
}

ClientMetric gauge(std::vector<ClientMetric::Label> labels, double value) {
  ClientMetric metric;
  metric.label = std::move(labels);
  metric.gauge.value = value;
  return metric;
}

ClientMetric info_of(const HealthMessage& health) {
  return gauge({{"node", health.node},
                {"program", health.program},
                {"version", health.version},
                {"state", std::string(name(health.state))},
                {"take", health.take}},
               1);
}

class LastHealth : public prometheus::Collectable {
 public:
  void set(const HealthMessage& health) {
    const std::lock_guard lock(mutex_);
    health_ = health;
  }

  std::vector<MetricFamily> Collect() const override {
    const std::lock_guard lock(mutex_);
    std::map<std::string, MetricFamily> families;
    if (health_.node.empty()) return {};
    add(families, "v3d_info", info_of(health_));
    for (const auto& [value_name, value] : health_.values) {
      // Values of a camera have its name as prefix: "cam03.frames_missing".
      const size_t dot = value_name.find('.');
      std::vector<ClientMetric::Label> labels = {{"node", health_.node}};
      if (dot != std::string::npos) labels.push_back({"camera", value_name.substr(0, dot)});
      const std::string short_name =
          dot == std::string::npos ? value_name : value_name.substr(dot + 1);
      add(families, metric_name((dot == std::string::npos ? "" : "camera_") + short_name),
          gauge(std::move(labels), value));
    }
    std::vector<MetricFamily> list;
    for (auto& [family_name, family] : families) list.push_back(std::move(family));
    return list;
  }

 private:
  static void add(std::map<std::string, MetricFamily>& families, const std::string& family_name,
                  ClientMetric metric) {
    MetricFamily& family = families[family_name];
    family.name = family_name;
    family.help = "V3D health; see v3dctl(1)";
    family.type = prometheus::MetricType::Gauge;
    family.metric.push_back(std::move(metric));
  }

  mutable std::mutex mutex_;
  HealthMessage health_;
};

/// civetweb uses one thread per connection until the request has been read. A client that never
/// completes its request occupies a thread for the whole time limit.
std::vector<std::string> server_options(const std::string& address) {
  return {"listening_ports", address, "num_threads", "32", "request_timeout_ms", "1000"};
}

}  // namespace

class MetricsServer::Impl {
 public:
  explicit Impl(const std::string& address)
      : health_(std::make_shared<LastHealth>()), exposer_(server_options(address)) {
    exposer_.RegisterCollectable(health_);
  }
  void update(const HealthMessage& health) { health_->set(health); }

 private:
  const std::shared_ptr<LastHealth> health_;
  prometheus::Exposer exposer_;
};

MetricsServer::MetricsServer(const std::string& address) {
  try {
    impl_ = std::make_unique<Impl>(address);
  } catch (const std::exception&) {  // civetweb gives no reason
    throw InputError("network.metrics: cannot listen on " + address +
                     "; is it an address of this PC, and free?");
  }
}
MetricsServer::~MetricsServer() = default;
void MetricsServer::update(const HealthMessage& health) { impl_->update(health); }

std::unique_ptr<MetricsServer> serve_metrics(const std::string& address) {
  if (address.empty()) return nullptr;
  try {
    return std::make_unique<MetricsServer>(address);
  } catch (const InputError& error) {
    spdlog::warn("{}", error.what());
    return nullptr;
  }
}

}  // namespace v3d
