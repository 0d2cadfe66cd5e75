#include "v3dctl/take_listing.h"

#include <algorithm>
#include <cstdio>

#include "base/error.h"
#include "base/units.h"
#include "common/console.h"
#include "common/local_time.h"
#include "take/ledger.h"
#include "take/mesh_file.h"
#include "take/verified.h"

namespace v3d::ctl {
namespace {

namespace fs = std::filesystem;

int64_t bytes_in(const fs::path& folder) {
  int64_t bytes = 0;
  std::error_code error;
  for (const auto& entry : fs::recursive_directory_iterator(folder, error)) {
    if (entry.is_regular_file(error)) bytes += static_cast<int64_t>(entry.file_size(error));
  }
  return bytes;
}

}  // namespace

std::string_view TakeListing::verdict() const {
  if (info.state == TakeState::kRecording) return "recording";
  if (!whole) return "incomplete";
  return info.state == TakeState::kRecovered ? "recovered" : "complete";
}

TakeListing look_at_take(const TakePaths& paths) {
  TakeListing take;
  take.paths = paths;
  take.info = load_take_info(paths);
  if (fs::exists(paths.ledger())) take.whole = load_ledger(paths.ledger()).complete();
  if (fs::exists(paths.mesh())) take.meshes = std::ssize(MeshFileReader(paths.mesh()).pulses());
  take.verified = load_verified(paths).has_value();
  take.bytes = bytes_in(paths.folder);
  take.slate = load_slate(paths.slate());
  return take;
}

std::vector<TakeListing> find_takes(const fs::path& folder) {
  if (!fs::is_directory(folder)) throw InputError(folder.string() + ": is no folder of takes");
  std::vector<TakeListing> takes;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
    const TakePaths paths{entry.path()};
    if (!fs::exists(paths.info())) continue;
    try {
      takes.push_back(look_at_take(paths));
    } catch (const InputError& error) {
      note(std::string("v3dctl: passed over: ") + error.what());
    }
  }
  std::sort(takes.begin(), takes.end(), [](const TakeListing& a, const TakeListing& b) {
    return std::tie(a.info.started, a.info.name) < std::tie(b.info.started, b.info.name);
  });
  return takes;
}

std::string format_length_of_time(double seconds) {
  const auto whole = static_cast<int64_t>(seconds + 0.5);
  char text[32];
  if (whole < 3600) {
    std::snprintf(text, sizeof text, "%d:%02d", static_cast<int>(whole / 60),
                  static_cast<int>(whole % 60));
  } else {
    std::snprintf(text, sizeof text, "%d:%02d:%02d", static_cast<int>(whole / 3600),
                  static_cast<int>(whole / 60 % 60), static_cast<int>(whole % 60));
  }
  return text;
}

std::vector<std::string> listing_lines(const std::vector<TakeListing>& takes) {
  size_t width = 4;
  for (const TakeListing& take : takes) width = std::max(width, take.info.name.size());
  std::vector<std::string> lines;
  for (const TakeListing& take : takes) {
    char text[512];
    std::snprintf(text, sizeof text,
                  "%-*s  %s  %-10s %-10s  %7s  %8s  %3zu cameras x %7s pulses, %g Hz, %s meshes",
                  static_cast<int>(width), take.info.name.c_str(),
                  local_time(take.info.started, "%Y-%m-%d %H:%M").c_str(), take.verdict().data(),
                  take.verified ? "verified" : "unverified",
                  format_length_of_time(take.seconds()).c_str(),
                  format_bytes(static_cast<double>(take.bytes)).c_str(), take.info.cameras.size(),
                  format_count(take.info.pulses).c_str(), take.info.rate_hz,
                  format_count(take.meshes).c_str());
    const std::string slate = take.slate.text();
    lines.push_back(text + (slate.empty() ? "" : "  " + slate));
  }
  return lines;
}

}  // namespace v3d::ctl
