// takes: the list of takes, and the subcommands slate, circle, reject, clear and sign.
#include <cstdio>

#include "base/core/error.h"
#include "base/core/printable.h"
#include "common/console.h"
#include "take/ledger/take_signature.h"
#include "v3dctl/options.h"
#include "v3dctl/takes/named_takes.h"

namespace v3d::ctl {
namespace {

int run_list(const CommandLine& line, const TakesArguments& arguments) {
  const auto report_skipped = [](const InputError& error) {
    note("v3dctl: skipped: " + printable(error.what()));
  };
  const std::filesystem::path folder = takes_folder(line, arguments);
  print_listing(find_takes(folder, report_skipped), arguments.json);
  const auto interrupted = io::value_or_throw(interrupted_deletions(folder));
  if (!interrupted.empty()) {
    note("v3dctl: " + interrupted_text(interrupted) + "; to finish: v3dctl takes delete --yes");
  }
  return kExitDone;
}

// --- slate and marks

struct SlateArguments {
  std::string scene, take, note;
};

/// Changes the slates of the named takes and prints the takes.
template <class Change>
int change_slates(const CommandLine& line, const TakesArguments& arguments, Change change) {
  std::vector<TakeListing> takes = named_takes(line, arguments);
  for (TakeListing& take : takes) {
    change(take.slate);
    io::throw_if_failed(save_slate(take.paths.slate(), take.slate));
  }
  print_listing(takes, arguments.json);
  return kExitDone;
}

/// Returns an error, or "" for text that fits in one line of a list.
std::string check_slate_text(const std::string& text) {
  constexpr size_t kMaxBytes = 4096;
  if (text.size() <= kMaxBytes && printable(text) == text) return "";
  return "expected at most 4,096 bytes of UTF-8 in one line, without control characters";
}

void add_slate(CommandLine& line, CLI::App* takes, const SharedTakesArguments& shared) {
  CLI::App* command =
      add_takes_subcommand(takes, "slate", "Write scene, take number and note on a take",
                           "v3dctl takes slate kendo-07 --scene 12 --take 3 --note \"slips\"");
  add_names_option(command, shared);
  auto arguments = std::make_shared<SlateArguments>();
  CLI::Option* const scene =
      command->add_option("--scene", arguments->scene, "Scene")->type_name("TEXT");
  CLI::Option* const take =
      command->add_option("--take", arguments->take, "Number of the take")->type_name("TEXT");
  CLI::Option* const note =
      command->add_option("--note", arguments->note, "Other text")->type_name("TEXT");
  for (CLI::Option* option : {scene, take, note}) option->check(check_slate_text, "");
  line.on_run(command, [&line, shared, arguments, scene, take, note] {
    return change_slates(line, *shared, [&](Slate& slate) {
      if (scene->count() > 0) slate.scene = arguments->scene;
      if (take->count() > 0) slate.take = arguments->take;
      if (note->count() > 0) slate.note = arguments->note;
    });
  });
}

void add_mark(CommandLine& line, CLI::App* takes, const SharedTakesArguments& shared,
              const std::string& name, Mark mark, const std::string& description) {
  CLI::App* command =
      add_takes_subcommand(takes, name, description, "v3dctl takes " + name + " kendo-07");
  add_names_option(command, shared);
  line.on_run(command, [&line, shared, mark] {
    return change_slates(line, *shared, [mark](Slate& slate) { slate.mark = mark; });
  });
}

// --- sign

struct SignArguments {
  SharedTakesArguments takes;
  std::string node;
  std::filesystem::path key;
};

int run_sign(const CommandLine& line, const SignArguments& arguments) {
  const std::filesystem::path key =
      arguments.key.empty() ? line.studio().storage.signing_key : arguments.key;
  if (key.empty()) {
    throw InputError(line.studio_path().string() +
                     ": [storage] signing_key is missing; name the file there, or with --key");
  }
  const TakeSigner signer{arguments.node, SigningKey::load(key)};
  for (const TakeListing& take : named_takes(line, *arguments.takes)) {
    if (take.info.state == TakeState::kRecording) {
      throw InputError(take.info.name +
                       " is being recorded, or was not closed: v3dctl verify --recover " +
                       take.paths.folder.string());
    }
    io::throw_if_failed(sign_whole_take(take.paths, signer, SigningOccasion::kCommand));
    std::printf("signed %s as %s\n", take.info.name.c_str(), arguments.node.c_str());
  }
  return kExitDone;
}

void add_sign(CommandLine& line, CLI::App* takes, const SharedTakesArguments& shared) {
  CLI::App* command = add_takes_subcommand(
      takes, "sign", "Sign takes that a restart left unsigned, on the PC that recorded them",
      "v3dctl takes sign kendo-07 --node cap01");
  auto arguments = std::make_shared<SignArguments>();
  arguments->takes = shared;
  add_names_option(command, shared);
  command->add_option("--node", arguments->node, "The node of this PC")
      ->type_name("NODE")
      ->required();
  command
      ->add_option("--key", arguments->key,
                   "Its signing key (otherwise [storage] signing_key of the studio file)")
      ->type_name("FILE");
  line.on_run(command, [&line, arguments] { return run_sign(line, *arguments); });
}

}  // namespace

void add_takes(CommandLine& line) {
  CLI::App* command = line.add(
      "takes", "List the takes in a folder, oldest first; mark, collect, delete",
      {"v3dctl takes", "v3dctl takes /srv/v3d/takes --json", "v3dctl takes circle kendo-07"});
  auto arguments = std::make_shared<TakesArguments>();
  command->add_option("--dir,DIR", arguments->folder,
                      "The folder of takes (otherwise that of the studio)");
  add_json_flag(command, arguments->json);
  line.on_run(command, [&line, arguments] { return run_list(line, *arguments); });
  add_slate(line, command, arguments);
  add_mark(line, command, arguments, "circle", Mark::kCircled, "Mark takes as good");
  add_mark(line, command, arguments, "reject", Mark::kRejected, "Mark takes as bad");
  add_mark(line, command, arguments, "clear", Mark::kNone, "Remove the mark");
  add_takes_collect(line, command, arguments);
  add_sign(line, command, arguments);
  add_takes_delete(line, command, arguments);
}

}  // namespace v3d::ctl
