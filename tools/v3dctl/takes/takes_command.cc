// takes, and what a crew does with them: slate, circle, reject, clear, collect, sign, delete.
#include <cstdio>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/name.h"
#include "base/printable.h"
#include "base/units.h"
#include "common/console.h"
#include "daemon/json.h"
#include "take/take_copy.h"
#include "take/take_removal.h"
#include "take/take_signature.h"
#include "take/verified.h"
#include "v3dctl/command_line.h"
#include "v3dctl/options.h"
#include "v3dctl/takes/collect.h"
#include "v3dctl/takes/named_takes.h"

namespace v3d::ctl {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

struct Arguments {
  fs::path folder;
  bool json = false;
  std::vector<std::string> names;
  // slate
  std::string scene, take, note;
  // collect
  fs::path to;
  std::vector<std::string> from;
  std::string rsh;
  // sign
  std::string node;
  fs::path key;
  // delete
  fs::path copy;
  bool no_copy = false;
  bool yes = false;
};
using SharedArguments = std::shared_ptr<Arguments>;

fs::path folder_of(const CommandLine& line, const Arguments& arguments) {
  return arguments.folder.empty() ? line.studio().storage.takes : arguments.folder;
}

/// The takes that were named, all of them there.
std::vector<TakeListing> named_takes(const CommandLine& line, const Arguments& arguments) {
  const fs::path folder = folder_of(line, arguments);
  std::vector<TakeListing> takes;
  for (const std::string& name : arguments.names) {
    if (!is_file_name(name)) {
      throw InputError("'" + name + "' is no name of a take: " + std::string(kFileNameRule));
    }
    takes.push_back(look_at_take({folder / name}));
  }
  return takes;
}

void print_listing(const std::vector<TakeListing>& takes, bool json) {
  if (json) {
    std::printf("%s\n", takes_json(takes, 2).c_str());
    return;
  }
  for (const std::string& line : listing_lines(takes)) std::printf("%s\n", line.c_str());
}

int run_list(const CommandLine& line, const Arguments& arguments) {
  const auto passed_over = [](const InputError& error) {
    note("v3dctl: passed over: " + printable(error.what()));
  };
  print_listing(find_takes(folder_of(line, arguments), passed_over), arguments.json);
  return kExitDone;
}

/// Changes the slates of the named takes, and shows them.
template <class Change>
int change_slates(const CommandLine& line, const Arguments& arguments, Change change) {
  std::vector<TakeListing> takes = named_takes(line, arguments);
  for (TakeListing& take : takes) {
    change(take.slate);
    io::throw_if_failed(save_slate(take.paths.slate(), take.slate));
  }
  print_listing(takes, arguments.json);
  return kExitDone;
}

// --- sign ---------------------------------------------------------------------------------------

int run_sign(const CommandLine& line, const Arguments& arguments) {
  const fs::path key = arguments.key.empty() ? line.studio().storage.signing_key : arguments.key;
  if (key.empty()) {
    throw InputError(line.studio_path().string() +
                     ": [storage] signing_key is missing; name the file there, or with --key");
  }
  const TakeSigner signer{arguments.node, SigningKey::load(key)};
  for (const TakeListing& take : named_takes(line, arguments)) {
    if (take.info.state == TakeState::kRecording) {
      throw InputError(take.info.name +
                       " is being recorded, or was never closed: v3dctl verify "
                       "--recover " +
                       take.paths.folder.string());
    }
    io::throw_if_failed(sign_recovered_take(take.paths, signer));
    std::printf("signed %s as %s\n", take.info.name.c_str(), arguments.node.c_str());
  }
  return kExitDone;
}

// --- delete -------------------------------------------------------------------------------------

[[noreturn]] void refuse_unverified(const TakeListing& take) {
  throw InputError(take.info.name + " is not verified, or has changed since: v3dctl verify " +
                   take.paths.folder.string());
}

void refuse_to_delete(const TakeListing& take) {
  const std::string& name = take.info.name;
  if (take.info.state == TakeState::kRecording) {
    throw InputError(name + " is being recorded, or was never closed: v3dctl verify --recover " +
                     take.paths.folder.string());
  }
  if (!take.examined) refuse_unverified(take);
  if (take.slate.mark == Mark::kCircled) {
    throw InputError(name + " is circled: v3dctl takes clear " + name);
  }
}

/// The copy is read from its disk. Throws InputError with the first of what it lacks.
void refuse_without_copy(const TakeListing& take, const fs::path& copies) {
  const auto verified = load_verified(take.paths);
  if (!verified) refuse_unverified(take);
  const TakePaths copy{copies / take.info.name};
  const std::vector<std::string> missing = missing_in_copy(take.paths, *verified, copy);
  if (missing.empty()) return;
  for (const std::string& text : missing) note(text);
  throw InputError(take.info.name + " is not deleted: its copy in " + copies.string() +
                   " lacks something; v3dctl takes collect brings it again once " +
                   copy.folder.string() + " is moved away");
}

int run_delete(const CommandLine& line, const Arguments& arguments) {
  if (arguments.copy.empty() == !arguments.no_copy) {
    throw InputError(
        "takes delete: name the folder of the copies, which are read back first (--copy DIR), or "
        "say that none is needed (--no-copy)");
  }
  const std::vector<TakeListing> takes = named_takes(line, arguments);
  double bytes = 0;
  for (const TakeListing& take : takes) {
    refuse_to_delete(take);
    bytes += static_cast<double>(take.bytes);
  }
  if (!arguments.yes) {
    for (const std::string& text : listing_lines(takes)) note(text);
    throw InputError(format_bytes(bytes) + " would be gone for good; to delete them add --yes");
  }
  for (const TakeListing& take : takes) {
    if (!arguments.no_copy) refuse_without_copy(take, arguments.copy);
  }
  for (const TakeListing& take : takes) {
    io::throw_if_failed(delete_take(take.paths));
    std::printf("deleted %s\n", take.info.name.c_str());
  }
  return kExitDone;
}

// --- collect ------------------------------------------------------------------------------------

TakeSource parse_source(const std::string& text) {
  const size_t equals = text.find('=');
  if (equals == std::string::npos || equals == 0 || equals + 1 == text.size()) {
    throw InputError("--from " + text + ": want NODE=PLACE, as in cap01=/mnt/cap01/takes");
  }
  const TakeSource source{text.substr(0, equals), text.substr(equals + 1)};
  if (!is_file_name(source.node)) {
    throw InputError("--from " + text + ": '" + source.node + "' cannot name a node");
  }
  return source;
}

bool is_whole(const CollectedTake& take) {
  return take.was_there || (take.problem.empty() && take.verification.whole());
}

std::string text_of(const CollectedTake& take) {
  if (take.was_there) return "take " + take.name + ": is there already";
  if (!take.problem.empty()) return "take " + take.name + ": not collected: " + take.problem;
  std::string text;
  for (const std::string& line : take.verification.disagreements) text += line + "\n";
  for (const std::string& line : take.verification.notes) text += "note: " + line + "\n";
  if (!take.meshes_of.empty())
    text += "mesh.v3d of " + take.meshes_of + ", which has most meshes\n";
  return text + take.verification.ledger.verdict();
}

Json collected_json(const std::vector<CollectedTake>& takes) {
  Json list = Json::array();
  for (const CollectedTake& take : takes) {
    list.push_back({{"name", take.name},
                    {"collected", take.problem.empty()},
                    {"was_there", take.was_there},
                    {"problem", take.problem},
                    {"meshes_of", take.meshes_of},
                    {"complete", is_whole(take)},
                    {"disagreements", take.verification.disagreements},
                    {"notes", take.verification.notes}});
  }
  return {{"takes", list}};
}

int run_collect(const CommandLine& line, const Arguments& arguments) {
  CollectRequest request;
  for (const std::string& text : arguments.from) request.sources.push_back(parse_source(text));
  if (request.sources.empty()) request.sources = sources_of(line.studio());
  request.to = arguments.to;
  request.takes = arguments.names;
  request.rsh = arguments.rsh;
  const std::vector<CollectedTake> takes = collect_takes(request);
  if (arguments.json) {
    std::printf("%s\n", collected_json(takes).dump(2).c_str());
  } else {
    for (const CollectedTake& take : takes) std::printf("%s\n", text_of(take).c_str());
    if (takes.empty()) note("v3dctl: no node has a take");
  }
  return std::all_of(takes.begin(), takes.end(), is_whole) ? kExitDone : kExitNotWhole;
}

// --- the command line ---------------------------------------------------------------------------

CLI::App* add_under(CLI::App* takes, const std::string& name, const std::string& description,
                    const std::string& example) {
  CLI::App* command = takes->add_subcommand(name, description);
  command->fallthrough();
  command->footer("Example:\n  $ " + example);
  return command;
}

void add_names(CLI::App* command, const SharedArguments& arguments) {
  command->add_option("NAME", arguments->names, "Takes")->required();
}

/// Accepts what a slate may say, in one line of every listing.
std::string check_slate_text(const std::string& text) {
  constexpr size_t kMaxBytes = 4096;
  if (text.size() <= kMaxBytes && printable(text) == text) return "";
  return "expected at most 4,096 bytes of UTF-8 in one line, without control characters";
}

void add_slate(CommandLine& line, CLI::App* takes, const SharedArguments& arguments) {
  CLI::App* command = add_under(takes, "slate", "Write scene, take number and note on a take",
                                "v3dctl takes slate kendo-07 --scene 12 --take 3 --note \"slips\"");
  add_names(command, arguments);
  CLI::Option* const scene =
      command->add_option("--scene", arguments->scene, "Scene")->type_name("TEXT");
  CLI::Option* const take =
      command->add_option("--take", arguments->take, "Number of the take")->type_name("TEXT");
  CLI::Option* const note =
      command->add_option("--note", arguments->note, "Anything else")->type_name("TEXT");
  for (CLI::Option* option : {scene, take, note}) option->check(check_slate_text, "");
  line.on_run(command, [&line, arguments, scene, take, note] {
    return change_slates(line, *arguments, [&](Slate& slate) {
      if (scene->count() > 0) slate.scene = arguments->scene;
      if (take->count() > 0) slate.take = arguments->take;
      if (note->count() > 0) slate.note = arguments->note;
    });
  });
}

void add_mark(CommandLine& line, CLI::App* takes, const SharedArguments& arguments,
              const std::string& name, Mark mark, const std::string& description) {
  CLI::App* command = add_under(takes, name, description, "v3dctl takes " + name + " kendo-07");
  add_names(command, arguments);
  line.on_run(command, [&line, arguments, mark] {
    return change_slates(line, *arguments, [mark](Slate& slate) { slate.mark = mark; });
  });
}

void add_collect(CommandLine& line, CLI::App* takes, const SharedArguments& arguments) {
  CLI::App* command =
      add_under(takes, "collect", "Copy takes from all nodes to one place, and verify them there",
                "v3dctl takes collect --to /mnt/archive kendo-07");
  command->add_option("NAME", arguments->names, "Takes (else all that are not there yet)");
  command->add_option("--to", arguments->to, "Folder that they are brought to")
      ->type_name("DIR")
      ->required();
  command
      ->add_option("--from", arguments->from,
                   "A node and its takes: a folder, or HOST:FOLDER; else those of the studio file")
      ->type_name("NODE=PLACE")
      ->expected(1)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  command->add_option("--rsh", arguments->rsh, "Remote shell of rsync (else ssh)")
      ->type_name("COMMAND");
  line.on_run(command, [&line, arguments] { return run_collect(line, *arguments); });
}

void add_sign(CommandLine& line, CLI::App* takes, const SharedArguments& arguments) {
  CLI::App* command =
      add_under(takes, "sign", "Sign takes that a restart left unsigned, on the PC that has them",
                "v3dctl takes sign kendo-07 --node cap01");
  add_names(command, arguments);
  command->add_option("--node", arguments->node, "The node of this PC")
      ->type_name("NODE")
      ->required();
  command
      ->add_option("--key", arguments->key,
                   "Its signing key (else [storage] signing_key of the studio file)")
      ->type_name("FILE");
  line.on_run(command, [&line, arguments] { return run_sign(line, *arguments); });
}

void add_delete(CommandLine& line, CLI::App* takes, const SharedArguments& arguments) {
  CLI::App* command = add_under(takes, "delete", "Delete takes that are verified and not circled",
                                "v3dctl takes delete kendo-06 --copy /mnt/archive --yes");
  add_names(command, arguments);
  command
      ->add_option("--copy", arguments->copy,
                   "Folder of takes with the copies; each is read back from its disk and compared")
      ->type_name("DIR");
  command->add_flag("--no-copy", arguments->no_copy, "Delete takes of which there is no copy");
  command->add_flag("--yes", arguments->yes, "Really; without it, say what would be deleted");
  line.on_run(command, [&line, arguments] { return run_delete(line, *arguments); });
}

}  // namespace

void add_takes(CommandLine& line) {
  CLI::App* command = line.add(
      "takes", "List the takes in a folder, oldest first; mark, collect, delete",
      {"v3dctl takes", "v3dctl takes /srv/v3d/takes --json", "v3dctl takes circle kendo-07"});
  auto arguments = std::make_shared<Arguments>();
  command->add_option("--dir,DIR", arguments->folder, "The folder of takes (else the studio's)");
  add_json_flag(command, arguments->json);
  line.on_run(command, [&line, arguments] { return run_list(line, *arguments); });
  add_slate(line, command, arguments);
  add_mark(line, command, arguments, "circle", Mark::kCircled, "Mark takes as good");
  add_mark(line, command, arguments, "reject", Mark::kRejected, "Mark takes as bad");
  add_mark(line, command, arguments, "clear", Mark::kNone, "Take the mark off again");
  add_collect(line, command, arguments);
  add_sign(line, command, arguments);
  add_delete(line, command, arguments);
}

}  // namespace v3d::ctl
