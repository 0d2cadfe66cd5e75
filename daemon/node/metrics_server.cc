#include "daemon/node/metrics_server.h"

#include <prometheus/metric_family.h>
#include <prometheus/text_serializer.h>
#include <spdlog/spdlog.h>

#include <cctype>
#include <map>
#include <mutex>
#include <stdexcept>
#include <vector>

#include "daemon/web/web_server.h"

namespace v3d::node {
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

ClientMetric info_of(const wire::HealthMessage& health) {
  return gauge({{"node", health.node},
                {"program", health.program},
                {"version", health.version},
                {"state", std::string(name(health.state))},
                {"take", health.take}},
               1);
}

class MetricsHandler final : public web::WebHandler {
 public:
  void set(const wire::HealthMessage& health) {
    const std::lock_guard lock(mutex_);
    health_ = health;
  }

  web::WebResponse respond(const web::WebRequest& request) override {
    const bool is_read = request.method == "GET" || request.method == "HEAD";
    if (!is_read || request.target != "/metrics") {
      return web::plain_response(404, "there is only GET /metrics");
    }
    return {.type = "text/plain; version=0.0.4; charset=utf-8",
            .body = prometheus::TextSerializer().Serialize(families())};
  }
  web::ClientRole role_of(const web::WebRequest& /*request*/) const override {
    return web::ClientRole::kViewer;
  }
  Opening open_stream(const web::WebRequest& /*request*/) override {
    return {nullptr, web::plain_response(404, "there is no stream")};
  }

 private:
  std::vector<MetricFamily> families() const {
    const std::lock_guard lock(mutex_);
    std::map<std::string, MetricFamily> families;
    if (health_.node.empty()) return {};
    add(families, "v3d_info", info_of(health_));
    add_camera_info(families);
    for (const auto& [value_name, value] : health_.values) {
      const auto [camera, name] = wire::split_health_name(value_name);
      std::vector<ClientMetric::Label> labels = {{"node", health_.node}};
      if (!camera.empty()) labels.push_back({"camera", camera});
      add(families, metric_name((camera.empty() ? "" : "camera_") + name),
          gauge(std::move(labels), value));
    }
    std::vector<MetricFamily> list;
    for (auto& [family_name, family] : families) list.push_back(std::move(family));
    return list;
  }

  /// v3d_camera_info: the texts of a camera ("cam03.firmware") as labels.
  void add_camera_info(std::map<std::string, MetricFamily>& families) const {
    std::map<std::string, std::vector<ClientMetric::Label>> labels;  // by camera
    for (const auto& [text_name, text] : health_.texts) {
      const auto [camera, name] = wire::split_health_name(text_name);
      if (camera.empty()) continue;
      auto& of_camera = labels[camera];
      if (of_camera.empty()) of_camera = {{"node", health_.node}, {"camera", camera}};
      of_camera.push_back({name, text});
    }
    for (auto& [camera, of_camera] : labels) {
      add(families, "v3d_camera_info", gauge(std::move(of_camera), 1));
    }
  }

  static void add(std::map<std::string, MetricFamily>& families, const std::string& family_name,
                  ClientMetric metric) {
    MetricFamily& family = families[family_name];
    family.name = family_name;
    family.help = "V3D health; see v3dctl(1)";
    family.type = prometheus::MetricType::Gauge;
    family.metric.push_back(std::move(metric));
  }

  mutable std::mutex mutex_;
  wire::HealthMessage health_;
};

}  // namespace

class MetricsServer::Impl {
 public:
  explicit Impl(const std::string& address)
      : server_(web::parse_web_address(address, "network.metrics"), handler_,
                {.keeps_alive = false}) {}
  void update(const wire::HealthMessage& health) { handler_.set(health); }
  uint16_t port() const { return server_.port(); }

 private:
  MetricsHandler handler_;
  web::WebServer server_;  ///< last: its thread uses the handler
};

MetricsServer::MetricsServer(const std::string& address) : impl_(std::make_unique<Impl>(address)) {}
MetricsServer::~MetricsServer() = default;
void MetricsServer::update(const wire::HealthMessage& health) { impl_->update(health); }
uint16_t MetricsServer::port() const { return impl_->port(); }

std::unique_ptr<MetricsServer> serve_metrics(const std::string& address) {
  if (address.empty()) return nullptr;
  try {
    return std::make_unique<MetricsServer>(address);
  } catch (const std::runtime_error& error) {
    spdlog::warn("{}", error.what());
    return nullptr;
  }
}

}  // namespace v3d::node
