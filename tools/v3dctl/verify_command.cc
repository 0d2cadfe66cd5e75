#include <cstdio>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "common/console.h"
#include "take/verify.h"
#include "v3dctl/command.h"
#include "v3dctl/operator_text.h"
#include "v3dctl/options.h"

namespace v3d::ctl {
namespace {

struct Arguments {
  std::filesystem::path take;
  bool recover = false;
  bool json = false;
};

Json verification_json(const Verification& verification) {
  Json json = to_json(verification.ledger);
  json["complete"] = verification.whole();
  json["state"] = name(verification.info.state);
  json["disagreements"] = verification.disagreements;
  return json;
}

void print_lines(const std::vector<std::string>& lines) {
  for (const std::string& line : lines) std::printf("%s\n", line.c_str());
}

void print_text(const Verification& verification) {
  print_lines(table_lines(verification.ledger));
  print_lines(trouble_lines(verification.ledger));
  print_lines(verification.disagreements);
  std::printf("%s\n", verification.ledger.verdict().c_str());
}

int run(const Arguments& arguments) {
  const TakePaths paths{arguments.take};
  const Verification verification = arguments.recover ? recover_take(paths) : verify_take(paths);
  if (arguments.json) {
    std::printf("%s\n", verification_json(verification).dump(2).c_str());
  } else {
    print_text(verification);
  }
  if (verification.info.state == TakeState::kRecording) {
    note(
        "v3dctl: this take was never closed; when nobody records into it any more: v3dctl verify "
        "--recover " +
        arguments.take.string());
    return kExitNotWhole;
  }
  return verification.whole() ? kExitDone : kExitNotWhole;
}

}  // namespace

void add_verify(CommandLine& line) {
  CLI::App* command = line.add("verify", "Check a take against its ledger, file by file",
                               {"v3dctl verify kendo-07", "v3dctl verify kendo-07 --json"});
  auto arguments = std::make_shared<Arguments>();
  command->add_option("TAKE", arguments->take, "The folder of the take")->required();
  command->add_flag("--recover", arguments->recover,
                    "Give a take that nobody closed (a power cut) the ledger that its files make");
  add_json_flag(command, arguments->json);
  line.on_run(command, [arguments] { return run(*arguments); });
}

}  // namespace v3d::ctl
