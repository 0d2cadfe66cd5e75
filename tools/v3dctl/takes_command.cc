#include <algorithm>
#include <cstdio>
#include <ctime>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/units.h"
#include "take/ledger.h"
#include "take/mesh_file.h"
#include "take/take.h"
#include "v3dctl/command.h"
#include "v3dctl/options.h"

namespace v3d::ctl {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

struct Listing {
  TakeInfo info;
  bool whole = false;  ///< by its ledger
  int64_t meshes = 0;
};

Listing look_at(const TakePaths& paths) {
  Listing listing{load_take_info(paths), false, 0};
  if (fs::exists(paths.ledger())) listing.whole = load_ledger(paths.ledger()).complete();
  if (fs::exists(paths.mesh())) listing.meshes = std::ssize(MeshFileReader(paths.mesh()).pulses());
  return listing;
}

// A folder that cannot be read as a take is told about and passed over.
std::vector<Listing> find_takes(const fs::path& folder) {
  if (!fs::is_directory(folder)) throw InputError(folder.string() + ": is no folder of takes");
  std::vector<Listing> takes;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
    const TakePaths paths{entry.path()};
    if (!fs::exists(paths.info())) continue;
    try {
      takes.push_back(look_at(paths));
    } catch (const InputError& error) {
      std::fprintf(stderr, "v3dctl: passed over: %s\n", error.what());
    }
  }
  std::sort(takes.begin(), takes.end(), [](const Listing& a, const Listing& b) {
    return std::tie(a.info.started, a.info.name) < std::tie(b.info.started, b.info.name);
  });
  return takes;
}

std::string local_time(RealtimeInstant instant) {
  const std::time_t seconds = to_ns(instant) / 1'000'000'000;
  std::tm parts{};
  localtime_r(&seconds, &parts);
  char text[32];
  std::strftime(text, sizeof text, "%Y-%m-%d %H:%M", &parts);
  return text;
}

std::string_view verdict(const Listing& take) {
  if (take.info.state == TakeState::kRecording) return "recording";
  if (!take.whole) return "incomplete";
  return take.info.state == TakeState::kRecovered ? "recovered" : "complete";
}

void print_text(const std::vector<Listing>& takes) {
  size_t width = 4;
  for (const Listing& take : takes) width = std::max(width, take.info.name.size());
  for (const Listing& take : takes) {
    std::printf("%-*s  %s  %-10s  %3zu cameras x %7s pulses, %g Hz, %s meshes\n",
                static_cast<int>(width), take.info.name.c_str(),
                local_time(take.info.started).c_str(), verdict(take).data(),
                take.info.cameras.size(), format_count(take.info.pulses).c_str(), take.info.rate_hz,
                format_count(take.meshes).c_str());
  }
}

void print_json(const std::vector<Listing>& takes) {
  Json list = Json::array();
  for (const Listing& take : takes) {
    list.push_back({{"name", take.info.name},
                    {"studio", take.info.studio},
                    {"started_ns", to_ns(take.info.started)},
                    {"state", verdict(take)},
                    {"rate_hz", take.info.rate_hz},
                    {"pulses", take.info.pulses},
                    {"cameras", take.info.cameras},
                    {"meshes", take.meshes}});
  }
  std::printf("%s\n", Json({{"takes", list}}).dump(2).c_str());
}

}  // namespace

void add_takes(CommandLine& line) {
  CLI::App* command = line.add("takes", "List the takes in a folder, oldest first",
                               {"v3dctl takes", "v3dctl takes /srv/v3d/takes --json"});
  struct Arguments {
    fs::path folder;
    bool json = false;
  };
  auto arguments = std::make_shared<Arguments>();
  command->add_option("DIR", arguments->folder, "The folder of takes (else the studio's)");
  add_json_flag(command, arguments->json);
  line.on_run(command, [&line, arguments]() -> int {
    const fs::path folder =
        arguments->folder.empty() ? line.studio().storage.takes : arguments->folder;
    const std::vector<Listing> takes = find_takes(folder);
    if (arguments->json) {
      print_json(takes);
    } else {
      print_text(takes);
    }
    return kExitDone;
  });
}

}  // namespace v3d::ctl
