#include "daemon/node/node_health.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <set>
#include <span>
#include <sstream>
#include <string_view>
#include <vector>

#include "base/core/text.h"
#include "daemon/bus/channel_list.h"
#include "wire/codec.h"
#include "wire/messages.h"
#include "wire/secret_keys.h"

namespace v3d::node {
namespace {

namespace fs = std::filesystem;

std::string first_line(const fs::path& path) {
  std::ifstream file(path);
  std::string line;
  std::getline(file, line);
  return line;
}

std::vector<int64_t> numbers_in(const std::string& text) {
  std::istringstream words(text);
  std::vector<int64_t> numbers;
  for (int64_t n = 0; words >> n;) numbers.push_back(n);
  return numbers;
}

/// "MemAvailable:   123 kB" of /proc/meminfo, "VmRSS:" of /proc/self/status.
std::optional<double> bytes_after(const fs::path& path, const std::string& key) {
  std::ifstream file(path);
  for (std::string line; std::getline(file, line);) {
    if (!line.starts_with(key)) continue;
    const auto numbers = numbers_in(line.substr(key.size()));
    if (!numbers.empty()) return 1024.0 * static_cast<double>(numbers.front());
  }
  return std::nullopt;
}

/// Lines: "cpu  user nice system idle iowait irq softirq steal ...", then "cpu0 ..." for each core.
int count_cores(const fs::path& stat) {
  std::ifstream file(stat);
  int cores = -1;  // the first line is the sum of all
  for (std::string line; std::getline(file, line);) cores += line.starts_with("cpu");
  return std::max(1, cores);
}

/// utime and stime are fields 14 and 15; the name, field 2, may hold spaces and parentheses.
std::optional<int64_t> ticks_of_process(const std::string& stat) {
  const size_t name_end = stat.rfind(')');
  if (name_end == std::string::npos || name_end + 4 > stat.size()) return std::nullopt;
  const auto fields = numbers_in(stat.substr(name_end + 3));  // after the state: from field 4 on
  if (fields.size() < 12) return std::nullopt;
  return fields[10] + fields[11];
}

double percent(int64_t part, int64_t whole) {
  return whole > 0 ? 100.0 * static_cast<double>(part) / static_cast<double>(whole) : 0;
}

constexpr double kNoTemperature = -274;  // below absolute zero

/// The file has thousandths of a degree. kNoTemperature where it cannot be read.
double celsius_in(const fs::path& path) {
  const auto numbers = numbers_in(first_line(path));
  return numbers.size() == 1 ? 1e-3 * static_cast<double>(numbers[0]) : kNoTemperature;
}

/// Whether the device of hwmon is the sensor of a processor.
bool is_of_processor(const fs::path& device) {
  constexpr std::array<std::string_view, 4> kDrivers = {"k10temp", "zenpower", "coretemp",
                                                        "cpu_thermal"};
  return std::find(kDrivers.begin(), kDrivers.end(), first_line(device / "name")) != kDrivers.end();
}

/// Highest reading of a device of hwmon, or kNoTemperature. Where it has Tdie of an AMD processor,
/// Tctl does not count: it is up to 27 degrees higher, to control fans.
double hottest_input(const fs::path& device) {
  constexpr std::string_view kInput = "input";
  double highest = kNoTemperature, control = kNoTemperature;
  bool has_die = false;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(device, error)) {
    const std::string file = entry.path().filename();
    if (!file.starts_with("temp") || !file.ends_with("_input")) continue;
    const std::string input = file.substr(0, file.size() - kInput.size());
    const std::string label = first_line(device / (input + "label"));
    has_die = has_die || label == "Tdie";
    double& of_label = label == "Tctl" ? control : highest;
    of_label = std::max(of_label, celsius_in(entry.path()));
  }
  return has_die ? highest : std::max(highest, control);
}

}  // namespace

std::optional<MachineHealth::Ticks> MachineHealth::read_ticks() const {
  const std::string line = first_line(root_ / "proc/stat");
  if (!line.starts_with("cpu ")) return std::nullopt;
  std::vector<int64_t> times = numbers_in(line.substr(4));
  if (times.size() < 5) return std::nullopt;
  times.resize(8);  // the following guest times are part of user time
  Ticks ticks;
  for (const int64_t time : times) ticks.all += time;
  ticks.busy = ticks.all - times[3] - times[4];  // idle, iowait
  ticks.daemon = ticks_of_process(first_line(root_ / "proc/self/stat")).value_or(0);
  ticks.cores = count_cores(root_ / "proc/stat");
  return ticks;
}

std::optional<double> MachineHealth::hottest() const {
  double highest = kNoTemperature, others = kNoTemperature;
  std::error_code error;
  for (const auto& zone : fs::directory_iterator(root_ / "sys/class/thermal", error)) {
    highest = std::max(highest, celsius_in(zone.path() / "temp"));
  }
  for (const auto& device : fs::directory_iterator(root_ / "sys/class/hwmon", error)) {
    double& of_kind = is_of_processor(device.path()) ? highest : others;
    of_kind = std::max(of_kind, hottest_input(device.path()));
  }
  const double reported = highest > kNoTemperature ? highest : others;
  return reported > kNoTemperature ? std::optional(reported) : std::nullopt;
}

void MachineHealth::update_processor_time() {
  const auto now = read_ticks();
  if (!now) return;
  const int64_t all = last_ ? now->all - last_->all : 0;
  // A few ticks would give a wrong percentage.
  if (last_ && all < kMinTicks * now->cores) return;
  if (last_) {
    machine_percent_ = percent(now->busy - last_->busy, all);
    daemon_percent_ = now->cores * percent(now->daemon - last_->daemon, all);
  }
  last_ = now;
}

void MachineHealth::report_appliance(std::map<std::string, double>& values) const {
  constexpr std::array<std::string_view, 7> kNames = {
      "slot_number",     "slot_trial_flag",        "boot_count",       "unclean_starts",
      "watchdog_resets", "disk_smart_failed_flag", "disk_wear_percent"};
  std::ifstream file(root_ / "run/v3d-appliance/health");
  std::string name;
  for (double value = 0; file >> name >> value;) {
    const bool known = std::find(kNames.begin(), kNames.end(), name) != kNames.end();
    if (known && std::isfinite(value)) values[name] = value;
  }
}

void MachineHealth::report(std::map<std::string, double>& values) {
  const auto add = [&](const char* name, std::optional<double> value) {
    if (value) values[name] = *value;
  };
  update_processor_time();
  add("cpu_machine_percent", machine_percent_);
  add("cpu_daemon_percent", daemon_percent_);
  add("memory_daemon_bytes", bytes_after(root_ / "proc/self/status", "VmRSS:"));
  add("memory_available_bytes", bytes_after(root_ / "proc/meminfo", "MemAvailable:"));
  add("temperature_max_celsius", hottest());
  report_appliance(values);
}

std::string appliance_version(const fs::path& root) {
  constexpr std::string_view kKey = "IMAGE_VERSION=";
  std::ifstream file(root / "etc/os-release");
  std::string version;
  bool is_appliance = false;
  for (std::string line; std::getline(file, line);) {
    is_appliance = is_appliance || line == "IMAGE_ID=v3d-appliance";
    if (line.starts_with(kKey)) version = line.substr(kKey.size());
  }
  return is_appliance ? printable(version) : "";
}

std::string version_with_appliance(std::string program, const fs::path& root) {
  const std::string system = appliance_version(root);
  return system.empty() ? program : program + "+" + system;
}

namespace {

constexpr size_t kQueue = 16;

/// 52 bits: exact in a double.
double random_instance() {
  return static_cast<double>(wire::random_nonce() & ((int64_t{1} << 52) - 1));
}

}  // namespace

NameMonitor::NameMonitor(bus::Bus& bus, std::string node)
    : node_(std::move(node)),
      instance_(random_instance()),
      healths_(bus, wire::health_channel(node_), kQueue) {}

void NameMonitor::mark(wire::HealthMessage& health) const { health.values[kInstance] = instance_; }

void NameMonitor::on_health(const wire::HealthMessage& health, MonotonicInstant now) {
  const auto instance = health.values.find(kInstance);
  const double sender = instance == health.values.end() ? -1 : instance->second;
  if (sender == instance_) return;
  const bool is_same = sender == other_ && last_of_other_ && now - *last_of_other_ <= kAlarmTime;
  messages_of_other_ = is_same ? messages_of_other_ + 1 : 1;
  other_ = sender;
  last_of_other_ = now;
}

std::string NameMonitor::alarm(MonotonicInstant now) {
  while (const auto health = healths_.wait(Monotonic::now())) on_health(*health, now);
  if (messages_of_other_ < 2 || !last_of_other_ || now - *last_of_other_ > kAlarmTime) return "";
  return "another process sends as node " + node_ + ": end one of the two; no take can be armed";
}

namespace {

constexpr size_t kMaxProblems = 8;
constexpr size_t kMaxText = 2048;

bool is_of_camera(const std::string& name) { return !wire::split_health_name(name).camera.empty(); }

/// What an operator must see of each camera.
bool is_important(const std::string& name) {
  static const std::set<std::string, std::less<>> kImportant = {"frames", "frames_missing",
                                                                "streaming_flag"};
  return kImportant.contains(wire::split_health_name(name).name);
}

void add_to_text(wire::HealthMessage& health, std::string_view what) {
  health.text += health.text.empty() ? "" : "; ";
  health.text += fmt::format("health has no {} of the cameras: too many for one message", what);
}

}  // namespace

std::string join_camera_problems(const std::vector<std::string>& problems) {
  const size_t shown = std::min(problems.size(), kMaxProblems);
  std::string line = fmt::format("{}", fmt::join(std::span(problems).first(shown), "; "));
  if (shown == problems.size()) return line;
  return line + fmt::format("; and {} more cameras", problems.size() - shown);
}

void shorten_health(wire::HealthMessage& health, size_t max_bytes) {
  const auto fits = [&] { return encode(health).size() <= max_bytes; };
  if (fits()) return;
  health.text = bus::shortened(health.text, kMaxText);
  if (fits()) return;
  const std::string text = health.text;
  std::erase_if(health.texts, [](const auto& entry) { return is_of_camera(entry.first); });
  add_to_text(health, "model and firmware");
  if (fits()) return;
  health.text = text;
  std::erase_if(health.values, [](const auto& entry) {
    return is_of_camera(entry.first) && !is_important(entry.first);
  });
  add_to_text(health, "detailed values");
  if (fits()) return;
  health.text = text;
  std::erase_if(health.values, [](const auto& entry) { return is_of_camera(entry.first); });
  add_to_text(health, "values");
}

}  // namespace v3d::node
