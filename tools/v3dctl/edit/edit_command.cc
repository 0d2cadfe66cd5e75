// edit: changes the action of a take by a list of operations; the result is a take of its own.
#include <fmt/core.h>

#include <cmath>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>

#include "base/core/error.h"
#include "base/io/file.h"
#include "common/console.h"
#include "common/partial_file.h"
#include "recon/editing/feet.h"
#include "take/take.h"
#include "v3dctl/command_line.h"
#include "v3dctl/edit/editor.h"
#include "v3dctl/options.h"

namespace v3d::ctl {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

struct Arguments {
  fs::path take, edits, out;
  bool json = false;
};

TakeClip read_with_progress(const fs::path& take) {
  std::optional<Progress> progress;
  return read_clip(
      take, [&](int64_t pulses) { progress.emplace("skeleton", pulses); },
      [&] { progress->advance(); });
}

/// Reads takes, and reports on stderr what their actions lack.
class TakeReader {
 public:
  TakeClip read(const fs::path& take) {
    TakeClip clip = read_with_progress(take);
    if (reported_.insert(fs::weakly_canonical(take)).second) report(take, clip);
    return clip;
  }
  /// kExitDone or kExitIncomplete.
  int status() const { return status_; }
  /// What is not whole or doubtful, each line with the take.
  const std::vector<std::string>& problems() const { return problems_; }

 private:
  void report(const fs::path& take, const TakeClip& clip) {
    if (clip.left_out > 0) {
      add_problem(take,
                  count_of(clip.left_out, "pulse") + " without a tracked surface are left out");
    }
    for (const std::string& problem : clip.problems) add_problem(take, problem);
    if (!clip.has_good_pulse) status_ = kExitIncomplete;
    if (clip.is_unfinished) status_ = report_missing_index(take::TakePaths{take}.mesh());
  }

  void add_problem(const fs::path& take, const std::string& problem) {
    problems_.push_back(take.string() + ": " + problem);
    note("v3dctl: " + problems_.back());
  }

  std::set<fs::path> reported_;  ///< takes
  std::vector<std::string> problems_;
  int status_ = kExitDone;
};

Json splice_json(const SpliceReport& report) {
  Json json{{"frame", report.frame},
            {"at", report.transition.at},
            {"from", report.transition.from},
            {"blend", report.transition.blend},
            {"cost_mm", 1000 * report.transition.cost_m}};
  if (std::isfinite(report.relative_jump)) json["relative_jump"] = report.relative_jump;
  return json;
}

/// How fast the surface moves at a splice; empty where it stands still around it.
std::string jump_text(const SpliceReport& report) {
  if (!std::isfinite(report.relative_jump)) return {};
  return fmt::format(", the surface moves {:.2f} times as fast as in the frames around it",
                     report.relative_jump);
}

void print_json(const fs::path& out, const recon::Clip& clip,
                const std::vector<SpliceReport>& splices, double slide_m,
                const std::vector<std::string>& problems) {
  Json list = Json::array();
  for (const SpliceReport& report : splices) list.push_back(splice_json(report));
  const Json json{{"out", out.string()},
                  {"frames", clip.frames.size()},
                  {"seconds", static_cast<double>(clip.frames.size()) / clip.rate_hz},
                  {"splices", list},
                  {"foot_slide_mm", 1000 * slide_m},
                  {"problems", problems}};
  fmt::print("{}\n", json.dump(2));
}

void print_text(const fs::path& out, const recon::Clip& clip,
                const std::vector<SpliceReport>& splices, double slide_m) {
  fmt::print("{}: {}, {:.1f} s\n", out.string(), count_of(std::ssize(clip.frames), "frame"),
             static_cast<double>(clip.frames.size()) / clip.rate_hz);
  for (const SpliceReport& report : splices) {
    fmt::print(
        "frame {}: continues with frame {} of the other take; the poses differ by {:.0f} mm{}\n",
        report.frame, report.next, 1000 * report.transition.cost_m, jump_text(report));
  }
  fmt::print("standing feet slide by at most {:.0f} mm\n", 1000 * slide_m);
}

/// Beside the take: TAKE.EDIT.
fs::path output_of(const Arguments& arguments) {
  if (!arguments.out.empty()) return arguments.out;
  const fs::path take = normal_folder(fs::weakly_canonical(arguments.take));
  return take.string() + "." + arguments.edits.stem().string();
}

/// Throws InputError where the result would replace a take that it is made of.
void require_other_output(const fs::path& take, const std::vector<Edit>& edits,
                          const fs::path& out) {
  std::error_code error;
  if (fs::equivalent(take, out, error)) {
    throw InputError(out.string() + ": is TAKE itself; choose another OUT");
  }
  for (const Edit& edit : edits) {
    const fs::path* other = take_of(edit);
    if (other == nullptr || !fs::equivalent(*other, out, error)) continue;
    throw InputError(edit.where + ".take: " + other->string() +
                     " is OUT itself; choose another OUT");
  }
}

int run(const Arguments& arguments) {
  catch_interrupts();
  const std::vector<Edit> edits = load_edits(arguments.edits);
  const std::string text = read_file(arguments.edits);
  const fs::path out = output_of(arguments);
  check_output(out);
  require_other_output(arguments.take, edits, out);
  TakeReader reader;
  TakeClip edited = reader.read(arguments.take);
  Editor editor(edited, [&](const fs::path& take) { return reader.read(take); });
  for (const Edit& edit : edits) editor.apply(edit);
  const double slide_m = recon::foot_slide(edited.clip, recon::foot_contacts(edited.clip));
  const fs::path place = normal_folder(fs::weakly_canonical(out));
  write_clip(edited, arguments.take, edits_for_folder(text, arguments.edits, place), out);
  if (arguments.json) {
    print_json(out, edited.clip, editor.splices(), slide_m, reader.problems());
  } else {
    print_text(out, edited.clip, editor.splices(), slide_m);
  }
  return reader.status();
}

}  // namespace

void add_edit(CommandLine& line) {
  cli::Command command = line.add(
      "edit", "Edit the action of a tracked take; the result is a take of its own",
      {"v3dctl edit dancer turn.json", "v3dctl edit dancer turn.json dancer-turned --json"});
  auto arguments = std::make_shared<Arguments>();
  command.add_option("TAKE", arguments->take, "The folder of a take with motion.v3d").required();
  command
      .add_option("EDIT", arguments->edits, "The list of operations, a JSON file (docs/editing.md)")
      .required();
  command.add_option("OUT", arguments->out,
                     "The folder of the new take; by default beside TAKE, as TAKE.EDIT");
  add_json_flag(command, arguments->json);
  line.on_run(command, [arguments] { return run(*arguments); });
}

}  // namespace v3d::ctl
