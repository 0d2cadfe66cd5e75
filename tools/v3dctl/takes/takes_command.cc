// takes: the list of takes, and the subcommands slate, circle, reject, clear and sign.
#include <algorithm>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <utility>

#include "base/core/error.h"
#include "base/core/text.h"
#include "common/console.h"
#include "take/ledger/take_signature.h"
#include "take/take_deletion.h"
#include "take/take_removal.h"
#include "v3dctl/options.h"
#include "v3dctl/takes/collect.h"
#include "v3dctl/takes/named_takes.h"

namespace v3d::ctl {
namespace {

using Json = nlohmann::ordered_json;

/// The name of the folder of a take: that in take.toml is another one in a copy with a new name.
std::string folder_name(const take::TakeListing& take) {
  return printable(take.paths.folder.filename().string());
}

int run_list(const CommandLine& line, const TakesArguments& arguments) {
  bool is_whole = true;
  const auto report_skipped = [&](const InputError& error) {
    is_whole = false;
    note("v3dctl: skipped: " + printable(error.what()));
  };
  const std::filesystem::path folder = takes_folder(line, arguments);
  print_listing(take::find_takes(folder, report_skipped), arguments.json);
  const auto interrupted = io::value_or_throw(take::interrupted_deletions(folder));
  if (!interrupted.empty()) {
    note("v3dctl: " + interrupted_text(interrupted) + "; to finish: v3dctl takes delete --yes");
  }
  return is_whole ? kExitDone : kExitIncomplete;
}

// --- slate and marks

struct SlateArguments {
  std::string scene, take, note;
};

/// Changes the slates of the named takes and prints the takes.
template <class Change>
int change_slates(const CommandLine& line, const TakesArguments& arguments, Change change) {
  std::vector<take::TakeListing> takes = named_takes(line, arguments);
  // The listings may be minutes old: somebody else may have written on a slate since.
  for (take::TakeListing& take : takes) take.slate = change_slate(take.paths, change);
  print_listing(takes, arguments.json);
  return kExitDone;
}

/// Returns an error, or "" for text that fits in one line of a list.
std::string check_slate_text(const std::string& text) {
  constexpr size_t kMaxBytes = 4096;
  if (text.size() <= kMaxBytes && printable(text) == text) return "";
  return "expected at most 4,096 bytes of UTF-8 in one line, without control characters";
}

void add_slate(CommandLine& line, cli::Command takes, const SharedTakesArguments& shared) {
  cli::Command command =
      add_takes_subcommand(takes, "slate", "Write scene, take number and note on a take",
                           "v3dctl takes slate kendo-07 --scene 12 --take 3 --note \"slips\"");
  add_names_option(command, shared);
  auto arguments = std::make_shared<SlateArguments>();
  const cli::Option scene =
      command.add_option("--scene", arguments->scene, "Scene").type_name("TEXT");
  const cli::Option take =
      command.add_option("--take", arguments->take, "Number of the take").type_name("TEXT");
  const cli::Option note =
      command.add_option("--note", arguments->note, "Other text").type_name("TEXT");
  for (cli::Option option : {scene, take, note}) option.check({check_slate_text, ""});
  line.on_run(command, [&line, shared, arguments, scene, take, note] {
    return change_slates(line, *shared, [&](take::Slate& slate) {
      if (scene.is_given()) slate.scene = arguments->scene;
      if (take.is_given()) slate.take = arguments->take;
      if (note.is_given()) slate.note = arguments->note;
    });
  });
}

void add_mark(CommandLine& line, cli::Command takes, const SharedTakesArguments& shared,
              const std::string& name, take::Mark mark, const std::string& description) {
  cli::Command command =
      add_takes_subcommand(takes, name, description, "v3dctl takes " + name + " kendo-07");
  add_names_option(command, shared);
  line.on_run(command, [&line, shared, mark] {
    return change_slates(line, *shared, [mark](take::Slate& slate) { slate.mark = mark; });
  });
}

// --- sign

struct SignArguments {
  SharedTakesArguments takes;
  std::string node;
  std::filesystem::path key;
};

/// Throws InputError unless this node may sign the take. A take without a studio file, such as an
/// imported one, does not name its nodes.
void require_signable(const take::TakeListing& take, const std::string& node) {
  if (take.info.state == take::TakeState::kRecording) {
    throw InputError(take.info.name +
                     " is being recorded, or was not closed: v3dctl verify --recover " +
                     take.paths.folder.string());
  }
  std::vector<std::string> names;
  for (const take::TakeNode& other : take::capture_nodes(take.paths)) names.push_back(other.name);
  if (names.empty() || std::ranges::find(names, node) != names.end()) return;
  throw InputError("--node " + node + ": did not record " + take.paths.folder.string() +
                   "; expected one of " + join_names(names));
}

int run_sign(const CommandLine& line, const SignArguments& arguments) {
  if (!is_file_name(arguments.node)) {
    throw InputError("--node '" + arguments.node + "': " + std::string(kFileNameRule));
  }
  const std::filesystem::path key =
      arguments.key.empty() ? line.studio().storage.signing_key : arguments.key;
  if (key.empty()) {
    throw InputError(line.studio_path().string() +
                     ": [storage] signing_key is missing; name the file there, or with --key");
  }
  const take::TakeSigner signer{arguments.node, wire::SigningKey::load(key)};
  const std::vector<take::TakeListing> takes = named_takes(line, *arguments.takes);
  for (const take::TakeListing& take : takes) require_signable(take, arguments.node);
  std::vector<std::string> signed_takes;
  for (const take::TakeListing& take : takes) {
    io::throw_if_failed(sign_whole_take(take.paths, signer, take::SigningOccasion::kCommand));
    signed_takes.push_back(folder_name(take));
    if (arguments.takes->json) continue;
    std::printf("signed %s as %s\n", signed_takes.back().c_str(), arguments.node.c_str());
  }
  if (arguments.takes->json) {
    std::printf("%s\n", Json{{"node", arguments.node}, {"signed", signed_takes}}.dump(2).c_str());
  }
  return kExitDone;
}

void add_sign(CommandLine& line, cli::Command takes, const SharedTakesArguments& shared) {
  cli::Command command = add_takes_subcommand(
      takes, "sign", "Sign takes that a restart left unsigned, on the PC that recorded them",
      "v3dctl takes sign kendo-07 --node cap01");
  auto arguments = std::make_shared<SignArguments>();
  arguments->takes = shared;
  add_names_option(command, shared);
  command.add_option("--node", arguments->node, "The node of this PC").type_name("NODE").required();
  command
      .add_option("--key", arguments->key,
                  "Its signing key (otherwise [storage] signing_key of the studio file)")
      .type_name("FILE");
  line.on_run(command, [&line, arguments] { return run_sign(line, *arguments); });
}

}  // namespace

void add_takes(CommandLine& line) {
  cli::Command command = line.add(
      "takes", "List the takes in a folder, oldest first; mark, collect, delete",
      {"v3dctl takes", "v3dctl takes /srv/v3d/takes --json", "v3dctl takes circle kendo-07"});
  auto arguments = std::make_shared<TakesArguments>();
  command.add_option("--dir,DIR", arguments->folder,
                     "The folder of takes (otherwise that of the studio)");
  add_json_flag(command, arguments->json);
  line.on_run(command, [&line, arguments] { return run_list(line, *arguments); });
  add_slate(line, command, arguments);
  add_mark(line, command, arguments, "circle", take::Mark::kCircled, "Mark takes as good");
  add_mark(line, command, arguments, "reject", take::Mark::kRejected, "Mark takes as bad");
  add_mark(line, command, arguments, "clear", take::Mark::kNone, "Remove the mark");
  add_takes_clap(line, command, arguments);
  add_takes_collect(line, command, arguments);
  add_sign(line, command, arguments);
  add_takes_delete(line, command, arguments);
}

// takes delete: the only command that deletes recordings.

namespace {

namespace fs = std::filesystem;

struct DeleteArguments {
  SharedTakesArguments takes;
  fs::path copy;
  bool no_copy = false;
  bool yes = false;
};

std::vector<take::InterruptedDeletion> interrupted_in(const fs::path& folder) {
  return io::value_or_throw(take::interrupted_deletions(folder));
}

/// Finishes all interrupted deletions, which were requested with --yes, and reports them.
/// `deleted`: the takes that the command has deleted; only JSON lists them.
void finish_deletions(const fs::path& folder, const std::vector<std::string>& deleted, bool json) {
  std::vector<std::string> finished;
  for (const take::InterruptedDeletion& deletion : interrupted_in(folder)) {
    io::throw_if_failed(finish_deletion(deletion));
    finished.push_back(printable(deletion.take));
    if (!json) std::printf("finished the deletion of %s\n", finished.back().c_str());
  }
  if (!json) return;
  std::printf("%s\n", Json{{"deleted", deleted}, {"finished", finished}}.dump(2).c_str());
}

/// `takes delete` without names.
int run_finish(const fs::path& folder, bool yes, bool json) {
  const std::vector<take::InterruptedDeletion> interrupted = interrupted_in(folder);
  if (interrupted.empty()) {
    throw InputError("takes delete: name the takes; " + folder.string() +
                     " has no interrupted deletion to finish");
  }
  if (!yes) {
    throw InputError(interrupted_text(interrupted) + "; add --yes to finish");
  }
  finish_deletions(folder, {}, json);
  return kExitDone;
}

/// Throws InputError for a name that is given twice.
void require_distinct(std::vector<std::string> names) {
  std::ranges::sort(names);
  const auto twice = std::ranges::adjacent_find(names);
  if (twice == names.end()) return;
  throw InputError("takes delete: " + *twice + " is named twice; name each take once");
}

int run_delete(const CommandLine& line, const DeleteArguments& arguments) {
  const fs::path folder = takes_folder(line, *arguments.takes);
  const bool json = arguments.takes->json;
  if (arguments.takes->names.empty()) return run_finish(folder, arguments.yes, json);
  require_distinct(arguments.takes->names);
  if (arguments.copy.empty() == !arguments.no_copy) {
    throw InputError(
        "takes delete: name the folder of the copies, which are read back first (--copy DIR), or "
        "say that none is needed (--no-copy)");
  }
  const std::vector<take::TakeListing> takes = named_takes(line, *arguments.takes);
  double bytes = 0;
  for (const take::TakeListing& take : takes) {
    take::require_deletable(take);
    bytes += static_cast<double>(take.bytes);
  }
  if (!arguments.yes) {
    for (const std::string& text : listing_lines(takes)) note(text);
    throw InputError(format_bytes(bytes) +
                     " would be deleted permanently; add --yes to delete them");
  }
  std::vector<take::TakePaths> paths;
  for (const take::TakeListing& take : takes) paths.push_back(take.paths);
  take::TakeDeletion deletion(std::move(paths), arguments.copy);
  deletion.compare([](const std::string& text) { note(text); });
  std::vector<std::string> deleted;
  for (const take::TakeListing& take : takes) {
    deletion.remove(take.paths);
    deleted.push_back(folder_name(take));
    if (!json) std::printf("deleted %s\n", deleted.back().c_str());
  }
  finish_deletions(folder, deleted, json);
  return kExitDone;
}

}  // namespace

void add_takes_delete(CommandLine& line, cli::Command takes, const SharedTakesArguments& shared) {
  cli::Command command =
      add_takes_subcommand(takes, "delete", "Delete takes that are verified and not circled",
                           "v3dctl takes delete kendo-06 --copy /mnt/archive --yes");
  auto arguments = std::make_shared<DeleteArguments>();
  arguments->takes = shared;
  command.add_option("NAME", shared->names, "Takes (none: finish deletions that were interrupted)");
  command
      .add_option("--copy", arguments->copy,
                  "Folder of takes with the copies; each is read back from its disk and compared")
      .type_name("DIR");
  command.add_flag("--no-copy", arguments->no_copy, "Delete takes without a copy");
  command.add_flag("--yes", arguments->yes,
                   "Delete; otherwise the command only lists what it would delete");
  line.on_run(command, [&line, arguments] { return run_delete(line, *arguments); });
}

// takes collect: options and results of collect_takes().

namespace {

struct CollectArguments {
  SharedTakesArguments takes;
  std::filesystem::path to;
  std::vector<std::string> from;
  std::string rsh;
};

NodeFolder parse_source(const std::string& text) {
  const size_t equals = text.find('=');
  if (equals == std::string::npos || equals == 0 || equals + 1 == text.size()) {
    throw InputError("--from " + text + ": expected NODE=PLACE, such as cap01=/mnt/cap01/takes");
  }
  const NodeFolder source{text.substr(0, equals), text.substr(equals + 1)};
  if (!is_file_name(source.node)) {
    throw InputError("--from " + text + ": '" + source.node + "' cannot be the name of a node");
  }
  return source;
}

bool is_whole(const CollectedTake& take) {
  return take.problem.empty() && take.verification.whole();
}

/// "take kendo-07: exists already, complete, 15 cameras x 1,250 pulses, 0 missing, 0 suspect".
std::string text_of_existing(const take::Ledger& ledger, const std::string& name) {
  const std::string text = "take " + name + ": exists already";
  if (ledger.take.empty()) return text;  // it could not be read
  return text + ", " + ledger.verdict().substr(("take " + ledger.take + ": ").size());
}

std::string text_of(const CollectedTake& take) {
  if (!take.problem.empty()) {
    return "take " + take.name + ": not collected: " + printable_text(take.problem);
  }
  std::string text;
  for (const std::string& line : take.verification.disagreements) text += printable(line) + "\n";
  for (const std::string& line : take.verification.notes) text += "note: " + printable(line) + "\n";
  if (!take.meshes_of.empty()) {
    text += "mesh.v3d of " + take.meshes_of + ", which has most meshes\n";
  }
  const take::Ledger& ledger = take.verification.ledger;
  return text + (take.was_there ? text_of_existing(ledger, take.name) : ledger.verdict());
}

Json collected_json(const std::vector<CollectedTake>& takes) {
  Json list = Json::array();
  for (const CollectedTake& take : takes) {
    list.push_back({{"name", take.name},
                    {"collected", take.problem.empty()},
                    {"was_there", take.was_there},
                    {"problem", printable_text(take.problem)},
                    {"meshes_of", take.meshes_of},
                    {"complete", is_whole(take)},
                    {"disagreements", printable_lines(take.verification.disagreements)},
                    {"notes", printable_lines(take.verification.notes)}});
  }
  return {{"takes", list}};
}

/// Reads --from. Throws InputError for a node that is given twice: both folders would be mixed.
std::vector<NodeFolder> parse_sources(const std::vector<std::string>& texts) {
  std::vector<NodeFolder> sources;
  for (const std::string& text : texts) {
    NodeFolder source = parse_source(text);
    if (std::ranges::find(sources, source.node, &NodeFolder::node) != sources.end()) {
      throw InputError("--from " + text + ": " + source.node +
                       " is given twice; expected each node once");
    }
    sources.push_back(std::move(source));
  }
  return sources;
}

int run_collect(const CommandLine& line, const CollectArguments& arguments) {
  if (!arguments.takes->folder.empty()) {
    throw InputError("takes collect: the folder of takes " + arguments.takes->folder.string() +
                     " is not used; expected the folders of the nodes, with --from NODE=PLACE");
  }
  CollectRequest request;
  request.sources = parse_sources(arguments.from);
  if (request.sources.empty()) request.sources = sources_of(line.studio());
  request.to = arguments.to;
  request.takes = arguments.takes->names;
  request.rsh = arguments.rsh;
  const std::vector<CollectedTake> takes = collect_takes(request);
  if (arguments.takes->json) {
    std::printf("%s\n", collected_json(takes).dump(2).c_str());
  } else {
    for (const CollectedTake& take : takes) std::printf("%s\n", text_of(take).c_str());
    if (takes.empty()) note("v3dctl: no node has a take");
  }
  return std::all_of(takes.begin(), takes.end(), is_whole) ? kExitDone : kExitIncomplete;
}

}  // namespace

void add_takes_collect(CommandLine& line, cli::Command takes, const SharedTakesArguments& shared) {
  cli::Command command = add_takes_subcommand(
      takes, "collect", "Copy takes from all nodes into one folder and verify the copies",
      "v3dctl takes collect --to /mnt/archive kendo-07");
  auto arguments = std::make_shared<CollectArguments>();
  arguments->takes = shared;
  command.add_option("NAME", shared->names, "Takes (otherwise all that are not there yet)");
  command.add_option("--to", arguments->to, "The folder of the copies").type_name("DIR").required();
  command
      .add_option("--from", arguments->from,
                  "A node and its takes: a folder, or HOST:FOLDER (otherwise the nodes of the "
                  "studio file)")
      .type_name("NODE=PLACE")
      .take_one_word();
  command.add_option("--rsh", arguments->rsh, "Remote shell of rsync (otherwise ssh)")
      .type_name("COMMAND");
  line.on_run(command, [&line, arguments] { return run_collect(line, *arguments); });
}

}  // namespace v3d::ctl
