#include "base/config/v4l2_address.h"

#include <algorithm>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

#include "base/core/error.h"
#include "base/core/text.h"

namespace v3d {
namespace {

constexpr std::string_view kBus = "bus:";
constexpr std::string_view kFirst = "-video-index0";  ///< end of the links to first device files

/// Names of the links to the first device file of each camera, without kFirst.
std::vector<std::string> cameras_in(const std::filesystem::path& folder) {
  std::vector<std::string> names;
  std::error_code error;
  for (std::filesystem::directory_iterator entry(folder, error), end; !error && entry != end;
       entry.increment(error)) {
    std::string name = entry->path().filename();
    if (!name.ends_with(kFirst)) continue;
    name.resize(name.size() - kFirst.size());
    names.push_back(std::move(name));
  }
  std::sort(names.begin(), names.end());
  return names;
}

[[noreturn]] void reject(const StudioCamera& settings, const std::string& problem,
                         const std::vector<std::string>& found) {
  throw InputError("camera " + settings.name + ": " + problem +
                   "; found: " + (found.empty() ? "no camera" : join_names(found)));
}

}  // namespace

std::filesystem::path v4l2_device(const StudioCamera& settings,
                                  const std::filesystem::path& links) {
  const std::string_view address = settings.address;
  if (address.starts_with('/')) return address;
  const bool is_bus = address.starts_with(kBus);
  const auto folder = links / (is_bus ? "by-path" : "by-id");
  const auto names = cameras_in(folder);
  // udev joins vendor, model and serial number by "_".
  const std::string wanted = is_bus ? std::string(address.substr(kBus.size())) : settings.address;
  std::vector<std::string> fitting;
  std::copy_if(names.begin(), names.end(), std::back_inserter(fitting), [&](const auto& name) {
    return name == wanted || (!is_bus && name.ends_with("_" + wanted));
  });
  if (fitting.empty()) {
    reject(settings,
           (is_bus ? "no camera at the bus path '" : "no camera has the serial number '") + wanted +
               "'",
           names);
  }
  if (fitting.size() > 1) {
    reject(settings,
           "several cameras have the serial number '" + wanted +
               "'; expected one; use the bus path or the whole name",
           fitting);
  }
  return folder / (fitting.front() + std::string(kFirst));
}

}  // namespace v3d
