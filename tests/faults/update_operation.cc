#include "update_operation.h"

#include <algorithm>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "base/io/file.h"
#include "support/temporary_folder.h"

namespace v3d::test {
namespace {

namespace fs = std::filesystem;
using Lost = std::vector<std::string>;
using Marks = std::vector<std::string>;

constexpr const char* kRequest = "7";
constexpr const char* kNextRequest = "8";
constexpr const char* kOldSystem = "1-old\n";

/// A system, longer than the blocks in which rsync and RAUC write it. Its last line is its version.
std::string new_system() {
  std::string text;
  for (int line = 0; text.size() < 300'000; ++line) text += std::to_string(line * 7919) + "\n";
  return text + "2-new\n";
}

/// Folder that no power cut reaches: the operator's bundle, and what the test keeps of the PC.
fs::path work(const FaultyWorkplace& place) { return place.disk().parent_path(); }
fs::path slot(const FaultyWorkplace& place, const std::string& name) {
  return place.disk() / "slots" / name;
}

std::vector<std::string> steps(const FaultyWorkplace& place,
                               const std::vector<std::string>& words) {
  const std::string source = V3D_SOURCE_DIR;
  const std::string driver = V3D_UPDATE_DRIVER;
  std::vector<std::string> command = {
      "/usr/bin/env",
      "DISK=" + place.disk().string(),
      "WORK=" + work(place).string(),
      "DRIVER=" + driver,
      "LIB=" + source + "/tools/appliance/root/usr/lib/v3d-appliance",
      source + "/tests/faults/appliance/steps"};
  command.insert(command.end(), words.begin(), words.end());
  return command;
}

/// Runs steps without faults. Returns what they reported.
Marks marks_of(const FaultyWorkplace& place, const std::vector<std::string>& words) {
  write_text(place.marks(), "");
  const ProgramResult result = place.run(steps(place, words), {});
  if (result.status != 0) throw std::runtime_error("steps: " + result.err);
  return place.marked();
}

void prepare(const FaultyWorkplace& place) {
  for (const char* folder : {"updates", "appliance", "boot", "slots", "takes"}) {
    fs::create_directories(place.disk() / folder);
  }
  write_text(place.disk() / "boot/grubenv", std::string(1024, '#'));
  write_text(slot(place, "A"), kOldSystem);
  write_text(slot(place, "B"), "");
  write_text(place.disk() / "takes/cam01.lcmlog", "recorded");
  write_text(work(place) / "bundle", new_system());
  // An interrupted copy of another bundle, with the size and the time of this one.
  write_text(place.disk() / "updates/bundle.raucb", std::string(new_system().size(), '#'));
  fs::last_write_time(place.disk() / "updates/bundle.raucb",
                      fs::last_write_time(work(place) / "bundle"));
}

bool contains(const Marks& marks, const std::string& mark) {
  return std::ranges::find(marks, mark) != marks.end();
}
bool reports(const Marks& marks, const std::string& state) {
  return std::ranges::any_of(
      marks, [&](const std::string& mark) { return mark.starts_with("update: " + state); });
}

/// State of the report on `request`; empty while there is none.
std::string state_of(const FaultyWorkplace& place, const std::string& request) {
  const fs::path file = place.disk() / "updates/result.json";
  if (!fs::exists(file)) return "";
  const auto report = nlohmann::json::parse(read_file(file));
  return report.at("request") == request ? report.at("state").get<std::string>() : "";
}
bool is_final(const std::string& state) {
  return state == "refused" || state == "failed" || state == "restarting";
}

/// Each slot that started is whole, and with `is_updated` the new one.
void check_starts(const FaultyWorkplace& place, const Marks& marks, bool is_updated, Lost& lost) {
  for (const std::string& mark : marks) {
    if (!mark.starts_with("starts ")) continue;
    const std::string system = read_file(slot(place, mark.substr(7)));
    const bool is_new = system == new_system();
    if (!is_new && system != kOldSystem) lost.push_back(mark + ", which is half written");
    if (is_updated && !is_new) lost.push_back(mark + ", the old system, after an update");
  }
}

/// `marks` are those of one request.
void check_installations(const Marks& marks, Lost& lost) {
  if (contains(marks, "installs damaged bytes"))
    lost.emplace_back("a half copied bundle is installed");
  if (std::ranges::count(marks, "installs the bundle") > 1) {
    lost.emplace_back("a request is executed twice");
  }
}

/// The PC starts and finishes what it finds. v3dctl repeats a request that it has sent.
void check_first_update(const FaultyWorkplace& place, const Marks& before, Lost& lost) {
  Marks marks = marks_of(place, {"boot", "install", "boot"});
  if (contains(before, "requested")) {
    std::ranges::move(marks_of(place, {"request", kRequest, "install", "boot"}),
                      std::back_inserter(marks));
    const std::string state = state_of(place, kRequest);
    if (!is_final(state)) lost.push_back("the report on a request stays '" + state + "'");
  }
  const bool was_updated = reports(before, "restarting");
  for (const char* state : {"refused", "failed"}) {
    if (reports(before, state) || (was_updated && reports(marks, state))) {
      lost.push_back(std::string("the report is '") + state + "'");
    }
  }
  check_starts(place, marks, was_updated, lost);
  if (state_of(place, kRequest) == "restarting") check_starts(place, {marks.back()}, true, lost);
  std::ranges::copy(before, std::back_inserter(marks));
  check_installations(marks, lost);
}

Lost check(const FaultyWorkplace& place, const ProgramResult&) {
  Lost lost;
  check_first_update(place, place.marked(), lost);
  const Marks marks = marks_of(place, {"copy", (work(place) / "bundle").string(), "request",
                                       kNextRequest, "install", "boot"});
  if (state_of(place, kNextRequest) != "restarting") {
    lost.push_back("a repeated update is '" + state_of(place, kNextRequest) + "'");
  }
  check_starts(place, marks, true, lost);
  check_installations(marks, lost);
  for (const char* rest : {"updates/request", "appliance/request", "appliance/bundle.raucb"}) {
    if (fs::exists(place.disk() / rest)) lost.push_back(std::string(rest) + " stays");
  }
  if (read_file(place.disk() / "takes/cam01.lcmlog") != "recorded") lost.emplace_back("a take");
  return lost;
}

}  // namespace

FaultOperation update_operation() {
  FaultOperation operation{.name = "update",
                           .program = {},
                           .prepare = prepare,
                           .command =
                               [](const FaultyWorkplace& place) {
                                 return steps(place,
                                              {"boot", "copy", (work(place) / "bundle").string(),
                                               "request", kRequest, "install"});
                               },
                           .check = check};
  return operation;
}

}  // namespace v3d::test
