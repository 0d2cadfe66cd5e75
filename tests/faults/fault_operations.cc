#include "fault_operations.h"

#include <sys/wait.h>

#include <algorithm>
#include <cstdlib>
#include <iterator>
#include <map>
#include <sstream>
#include <stdexcept>

#include "base/io/file.h"
#include "daemon/bus/credential_files.h"
#include "recorded_take.h"
#include "support/temporary_folder.h"
#include "take/ledger/take_account.h"
#include "take/ledger/verify.h"
#include "take/logs/frame_log.h"
#include "take/logs/mesh_file.h"
#include "take/take_listing.h"
#include "wire/signatures.h"

namespace v3d::test {
namespace {

namespace fs = std::filesystem;
using Lost = std::vector<std::string>;

const std::string kTake = "take";
constexpr size_t kSimulatedPulses = 2;

// --- the driver ---------------------------------------------------------------------------------

take::TakePaths driven_take(const FaultyWorkplace& place) {
  return {driven_studio(place.disk()).storage.takes / kDrivenTake};
}

std::vector<std::string> driver(const FaultyWorkplace& place, const std::string& operation) {
  return {V3D_RECORD_DRIVER, operation, place.disk(), place.marks()};
}

void expect_marked_frame(const take::TakePaths& take, const std::string& mark, Lost& lost) {
  std::istringstream words(mark);
  std::string word, camera;
  int64_t pulse = 0;
  if (!(words >> word >> camera >> pulse) || word != "frame") return;
  try {
    const auto frame = take::FrameLogReader(take.frames(camera)).read(pulse);
    const auto recorded = recorded_frame(camera, pulse, kDrivenSize).frame.image.bytes;
    if (!frame) {
      lost.push_back("acknowledged " + mark + " cannot be read");
    } else if (frame->image.bytes != recorded) {
      lost.push_back("acknowledged " + mark + " has other pixels");
    }
  } catch (const std::exception& error) {
    lost.push_back("acknowledged " + mark + ": " + error.what());
  }
}

/// Recovers open takes, as a daemon does that starts after a power cut. Adds losses to `lost`.
void expect_recovery(const FaultyWorkplace& place, bool is_ready, Lost& lost) {
  if (is_ready) std::ranges::move(missing_studio_copies(place.disk()), std::back_inserter(lost));
  const ProgramResult recovered = place.run(driver(place, "recover"), {});
  // A take that was never ready may lack files that a recovery needs.
  const bool is_good = recovered.status == 0 || (recovered.status == 3 && !is_ready);
  if (!is_good) lost.push_back("after the power cut: " + recovered.err);
}

/// Number of marks up to the last one that guarantees data: "synced", "recovered" or "complete".
size_t end_of_synced(const std::vector<std::string>& marks) {
  const auto last = std::find_if(marks.rbegin(), marks.rend(), [](const std::string& mark) {
    return mark == "synced" || mark == "recovered" || mark == "complete";
  });
  return static_cast<size_t>(marks.rend() - last);
}

/// Checks that a quarantined take lies at the reported path.
void expect_quarantined(const std::vector<std::string>& marks, Lost& lost) {
  const std::string reported = "quarantined ";
  for (const std::string& mark : marks) {
    if (!mark.starts_with(reported) || fs::exists(mark.substr(reported.size()))) continue;
    lost.push_back("missing: " + mark);
  }
}

/// Checks that every acknowledged frame can be read, or after a power cut every synced one. A take
/// that was reported as complete must be whole.
Lost check_driven(const FaultyWorkplace& place, const ProgramResult& result) {
  Lost lost;
  const take::TakePaths take = driven_take(place);
  auto marks = place.marked();
  const bool is_complete = !marks.empty() && marks.back() == "complete";
  expect_quarantined(marks, lost);
  if (result.is_power_cut) {
    expect_recovery(place, std::ranges::find(marks, "ready") != marks.end(), lost);
    marks.resize(end_of_synced(marks));
  }
  for (const std::string& mark : marks) expect_marked_frame(take, mark, lost);
  if (!is_complete) return lost;
  if (!fs::exists(take.folder / ("signature." + kDrivenNode + ".toml"))) {
    lost.emplace_back("reported as complete, but not signed");
  }
  try {
    if (!verify_take(take).whole()) lost.push_back("reported as complete, but verify disagrees");
  } catch (const std::exception& error) {
    lost.push_back(std::string("reported as complete: ") + error.what());
  }
  return lost;
}

/// A serial number that was reported as saved must be there. A torn file would throw.
Lost check_serial(const FaultyWorkplace& place, const ProgramResult&) {
  const auto marks = place.marked();
  const bool is_saved = std::ranges::find(marks, "serial") != marks.end();
  const Studio studio = driven_studio(place.disk());
  try {
    const int64_t serial =
        bus::AcceptedSerial(member_serial_file(studio), studio.name, "authority").load();
    if (is_saved && serial != kDrivenSerial) return {"the saved serial number is lost"};
  } catch (const std::exception& error) {
    return {error.what()};
  }
  return {};
}

void run_driver_to_cut(const FaultyWorkplace& place) {
  make_driven_studio(place.disk());
  if (place.run(driver(place, "cut"), {}).status != 0)
    throw std::runtime_error("record_driver cut");
}

FaultOperation driven(const std::string& name) {
  FaultOperation operation{
      .name = name,
      .program = {},
      .prepare = [](const FaultyWorkplace& place) { make_driven_studio(place.disk()); },
      .command = [name](const FaultyWorkplace& place) { return driver(place, name); },
      .check = check_driven};
  operation.may_do_less = name == "quarantine";  // a take that may hold frames is not moved
  if (name == "restart") operation.prepare = run_driver_to_cut;
  if (name == "serial") operation.check = check_serial;
  return operation;
}

// --- v3dctl -------------------------------------------------------------------------------------

void run_or_throw(const std::string& command) {
  const int status = std::system((command + " >/dev/null 2>&1").c_str());
  if (!WIFEXITED(status) || WEXITSTATUS(status) != 0) throw std::runtime_error(command);
}

/// A simulated, signed take with a slate. It is made once for all tests.
const fs::path& simulated_take() {
  static const TemporaryFolder folder("/dev/shm");
  static const fs::path take = [] {
    fs::path made = folder / kTake;
    run_or_throw(V3D_BIN "/v3d-sim take " + made.string() + " --frames " +
                 std::to_string(kSimulatedPulses) + " --cameras 3 --size 64x48");
    const std::string key = folder / "node.key";
    run_or_throw(V3D_BIN "/v3dctl key node --out " + key);
    run_or_throw(V3D_BIN "/v3dctl takes sign --dir " + folder.path().string() + " " + kTake +
                 " --node cap01 --key " + key);
    run_or_throw(V3D_BIN "/v3dctl takes slate --dir " + folder.path().string() + " " + kTake +
                 " --scene 11");
    return made;
  }();
  return take;
}

fs::path takes_of(const FaultyWorkplace& place) { return place.disk() / "takes"; }

bool is_recorded(const std::string& file) {
  return file.ends_with(".lcmlog") || file.ends_with("calib.toml") ||
         file.find("background/") != std::string::npos;
}

/// Returns the recorded files of the take that are missing or have changed, one line each.
Lost check_recorded(const fs::path& take) {
  Lost lost;
  const auto now = contents_of(take);
  for (const auto& [file, content] : contents_of(simulated_take())) {
    const auto found = now.find(file);
    if (!is_recorded(file)) continue;
    if (found == now.end()) {
      lost.push_back(file + " is missing");
    } else if (found->second != content) {
      lost.push_back(file + " has changed");
    }
  }
  return lost;
}

void expect_whole_text(const fs::path& file, const std::string& end, Lost& lost) {
  try {
    if (read_file(file).find(end) == std::string::npos) lost.push_back(file.string() + " is torn");
  } catch (const std::exception& error) {
    lost.emplace_back(error.what());
  }
}

FaultOperation of_simulated_take(const std::string& name, const fs::path& programs,
                                 std::vector<std::string> words) {
  return {.name = name,
          .program = "v3dctl",
          .prepare =
              [](const FaultyWorkplace& place) {
                copy_tree(simulated_take(), takes_of(place) / kTake);
              },
          .command =
              [=](const FaultyWorkplace& place) {
                std::vector<std::string> command = {programs / "v3dctl"};
                for (const std::string& word : words) {
                  const bool is_place = word.starts_with("@");
                  command.push_back(is_place ? (place.disk() / word.substr(1)).string() : word);
                }
                return command;
              },
          .check =
              [](const FaultyWorkplace& place, const ProgramResult&) {
                Lost lost = check_recorded(takes_of(place) / kTake);
                expect_whole_text(takes_of(place) / kTake / "take.toml", "cameras", lost);
                expect_whole_text(takes_of(place) / kTake / "ledger.toml", "cam03", lost);
                expect_whole_text(takes_of(place) / kTake / "slate.toml", "mark = ", lost);
                return lost;
              }};
}

/// True when the power was cut after the program had reported success.
bool is_cut_after_success(const ProgramResult& result) {
  return result.is_power_cut && !result.fired && result.status == 0;
}

/// Adds to the check of `operation`: after a power cut that follows success, `expect` must return
/// an empty string.
void expect_after_success(FaultOperation& operation,
                          const std::function<std::string(const take::TakePaths&)>& expect) {
  operation.check = [check = operation.check, expect](const FaultyWorkplace& place,
                                                      const ProgramResult& result) {
    Lost lost = check(place, result);
    if (!is_cut_after_success(result)) return lost;
    try {
      const std::string problem = expect({takes_of(place) / kTake});
      if (!problem.empty()) lost.push_back(problem);
    } catch (const std::exception& error) {
      lost.emplace_back(error.what());
    }
    return lost;
  };
}

FaultOperation verify_operation(const fs::path& programs) {
  FaultOperation operation = of_simulated_take("verify", programs, {"verify", "@takes/take"});
  expect_after_success(operation, [](const take::TakePaths& take) {
    return load_verified(take) ? "" : "verified.toml is lost";
  });
  return operation;
}

FaultOperation slate_operation(const fs::path& programs) {
  FaultOperation operation = of_simulated_take(
      "slate", programs, {"takes", "slate", "--dir", "@takes", kTake, "--scene", "12"});
  operation.lists_take = true;
  expect_after_success(operation, [](const take::TakePaths& take) {
    return take::load_slate(take.slate()).scene == "12" ? "" : "the new scene is lost";
  });
  return operation;
}

FaultOperation reconstruct_operation(const fs::path& programs) {
  FaultOperation operation = of_simulated_take(
      "reconstruct", programs,
      {"reconstruct", "@takes/take", "--voxel", "10cm", "--min-views", "2", "--threads", "1"});
  operation.has_reproducible_output = false;  // it prints times
  expect_after_success(operation, [](const take::TakePaths& take) {
    take::MeshFileReader meshes(take.mesh());
    const bool is_whole = meshes.pulses().size() == kSimulatedPulses &&
                          std::ranges::all_of(meshes.pulses(), [&](int64_t pulse) {
                            return io::value_or_throw(meshes.read(pulse)).has_value();
                          });
    return is_whole ? "" : "meshes are lost";
  });
  return operation;
}

/// Makes the signing key of a PC. A key file is whole or absent: a torn one would stop the daemons.
FaultOperation key_operation(const fs::path& programs) {
  FaultOperation operation =
      of_simulated_take("key", programs, {"key", "node", "--out", "@node.key"});
  operation.has_reproducible_output = false;  // it prints the key
  operation.makes_other_files = true;
  operation.prepare = [](const FaultyWorkplace& place) { fs::create_directories(place.disk()); };
  operation.check = [](const FaultyWorkplace& place, const ProgramResult& result) {
    const fs::path key = place.disk() / "node.key";
    if (!fs::exists(key)) return result.status == 0 ? Lost{"the key is lost"} : Lost();
    try {
      wire::SigningKey::load(key);
    } catch (const std::exception& error) {
      return Lost{error.what()};
    }
    return Lost();
  };
  return operation;
}

FaultOperation recover_operation(const fs::path& programs) {
  FaultOperation operation =
      of_simulated_take("recover", programs, {"verify", "--recover", "@takes/take"});
  operation.prepare = [](const FaultyWorkplace& place) {
    const take::TakePaths take{takes_of(place) / kTake};
    copy_tree(simulated_take(), take.folder);
    std::string info = read_file(take.info());
    const std::string complete = "'complete'";
    info.replace(info.find(complete), complete.size(), "'recording'");
    write_text(take.info(), info);
    fs::remove(take.ledger());
  };
  operation.check = [](const FaultyWorkplace& place, const ProgramResult&) {
    Lost lost = check_recorded(takes_of(place) / kTake);
    expect_whole_text(takes_of(place) / kTake / "take.toml", "cameras", lost);
    return lost;
  };
  operation.done = 3;  // 3: v3dctl reports the missing ledger
  return operation;
}

/// Checks that the next deletion finishes one that was interrupted.
void expect_finished_deletion(const FaultyWorkplace& place, Lost& lost) {
  const fs::path rest = takes_of(place) / (".deleted-" + kTake);
  if (!fs::exists(rest)) return;
  const ProgramResult finished =
      place.run({V3D_BIN "/v3dctl", "takes", "delete", "--dir", takes_of(place), "--yes"}, {});
  if (finished.status == 0 && !fs::exists(rest)) return;
  lost.push_back("an interrupted deletion is not finished: " + finished.err);
}

/// Deletes a take. For "delete_copied", v3dctl first reads back a copy in the archive.
FaultOperation delete_operation(const std::string& name, const fs::path& programs) {
  const bool with_copy = name == "delete_copied";
  std::vector<std::string> words = {"takes", "delete", "--dir", "@takes", kTake, "--yes"};
  if (with_copy) words.insert(words.end(), {"--copy", "@archive"});
  if (!with_copy) words.emplace_back("--no-copy");
  FaultOperation operation = of_simulated_take(name, programs, words);
  operation.prepare = [with_copy](const FaultyWorkplace& place) {
    copy_tree(simulated_take(), takes_of(place) / kTake);
    run_or_throw(V3D_BIN "/v3dctl verify " + (takes_of(place) / kTake).string());
    if (with_copy) copy_tree(takes_of(place) / kTake, place.disk() / "archive" / kTake);
  };
  operation.check = [with_copy](const FaultyWorkplace& place, const ProgramResult& result) {
    const bool is_listed = fs::exists(takes_of(place) / kTake);
    Lost lost;
    if (is_listed) lost = check_recorded(takes_of(place) / kTake);
    if (is_listed && result.status == 0) lost.push_back("reported as deleted, but still there");
    expect_finished_deletion(place, lost);
    if (!with_copy) return lost;
    for (const std::string& what : check_recorded(place.disk() / "archive" / kTake)) {
      lost.push_back("in the archive, " + what);
    }
    return lost;
  };
  operation.rejection = "is not verified, or has changed since: v3dctl verify";
  return operation;
}

/// Checks that the archive holds the whole take or nothing of that name, and that the same command
/// completes a failed collection.
Lost check_collected(const FaultyWorkplace& place, const ProgramResult& result,
                     const std::vector<std::string>& command) {
  const fs::path collected = place.disk() / "archive" / kTake;
  Lost lost = check_recorded(takes_of(place) / kTake);
  const auto check_archive = [&](const char* when) {
    for (const std::string& what : check_recorded(collected)) {
      lost.push_back("in the archive" + std::string(when) + ", " + what);
    }
  };
  if (fs::exists(collected)) check_archive("");
  if (result.status == 0) return lost;
  const ProgramResult again = place.run(command, {});
  if (again.status != 0) lost.push_back("the same command does not complete it: " + again.err);
  check_archive(" after the same command again");
  return lost;
}

FaultOperation collect_operation(const std::string& name, const fs::path& programs) {
  FaultOperation operation = of_simulated_take(name, programs, {});
  operation.command = [programs](const FaultyWorkplace& place) {
    return std::vector<std::string>{programs / "v3dctl",
                                    "takes",
                                    "collect",
                                    "--to",
                                    place.disk() / "archive",
                                    "--from",
                                    "cap01=" + takes_of(place).string()};
  };
  operation.check = [command = operation.command](const FaultyWorkplace& place,
                                                  const ProgramResult& result) {
    return check_collected(place, result, command(place));
  };
  if (name == "collect_rsync") {
    operation.program = "rsync";
    operation.rejection =
        "rsync from cap01 ended with status";  // rsync's own messages are above it
  }
  return operation;
}

}  // namespace

FaultOperation fault_operation(const std::string& name, const fs::path& programs) {
  if (name == "record" || name == "restart" || name == "quarantine" || name == "serial") {
    return driven(name);
  }
  if (name == "recover") return recover_operation(programs);
  if (name.starts_with("delete")) return delete_operation(name, programs);
  if (name.starts_with("collect")) return collect_operation(name, programs);
  if (name == "verify") return verify_operation(programs);
  if (name == "slate") return slate_operation(programs);
  if (name == "key") return key_operation(programs);
  return reconstruct_operation(programs);
}

}  // namespace v3d::test
