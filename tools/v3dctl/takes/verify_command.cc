// verify: checks a take against its ledger, signatures and, on request, its images.
#include <algorithm>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "base/core/error.h"
#include "base/core/printable.h"
#include "base/core/units.h"
#include "common/console.h"
#include "take/ledger/signature_check.h"
#include "take/ledger/verified.h"
#include "take/ledger/verify.h"
#include "take/take_lock.h"
#include "v3dctl/command_line.h"
#include "v3dctl/operate/reply_text.h"
#include "v3dctl/options.h"
#include "v3dctl/process.h"
#include "v3dctl/takes/image_check.h"

namespace v3d::ctl {
namespace {

struct Arguments {
  std::filesystem::path take;
  bool recover = false;
  bool images = false;
  bool is_signed = false;
  bool json = false;
};

Json images_json(const ImageCheckResult& result) {
  Json list = Json::array();
  for (size_t i = 0; i < result.frame_lags.size(); ++i) {
    const CameraSync& lag = result.frame_lags[i];
    const CameraDisplacement& displacement = result.displacements[i];
    list.push_back({{"name", lag.camera},
                    {"pulses_late", lag.pulses_late()},
                    {"frames", lag.frames},
                    {"disagreement", lag.disagreement},
                    {"knocked", displacement.displaced},
                    {"shift_px", {displacement.shift.x(), displacement.shift.y()}}});
  }
  return list;
}

/// File names in a take may have any bytes.
std::vector<std::string> printable_lines(std::vector<std::string> lines) {
  for (std::string& line : lines) line = printable(line);
  return lines;
}

Json verification_json(const Verification& verification) {
  Json json = to_json(verification.ledger);
  json["complete"] = verification.whole();
  json["state"] = name(verification.info.state);
  json["disagreements"] = printable_lines(verification.disagreements);
  json["notes"] = printable_lines(verification.notes);
  return json;
}

void print_lines(const std::vector<std::string>& lines) {
  for (const std::string& line : lines) std::printf("%s\n", printable(line).c_str());
}

Json signatures_json(const SignatureCheck& check) {
  Json list = Json::array();
  for (const SignedBy& signer : check.signers) {
    list.push_back({{"node", signer.node},
                    {"public_key", signer.key.text()},
                    {"known", signer.is_known},
                    {"occasion", name(signer.occasion)},
                    {"files", signer.files}});
  }
  return {{"complete", check.is_complete}, {"signers", std::move(list)}};
}

/// Says when a signature was made, if not at the stop of the take; otherwise empty.
const char* occasion_text(SigningOccasion occasion) {
  if (occasion == SigningOccasion::kRecovery) return "; signed after a recovery, not at the stop";
  if (occasion == SigningOccasion::kCommand) return "; signed by a command, not at the stop";
  return "";
}

void print_signers(const SignatureCheck& check) {
  for (const SignedBy& signer : check.signers) {
    std::printf("signed by %s, key %s%s: %s files match%s\n", signer.node.c_str(),
                signer.key.text().c_str(), signer.is_known ? "" : " (not in the studio file)",
                format_count(signer.files).c_str(), occasion_text(signer.occasion));
  }
}

/// Adds disagreements and notes to `verification`.
SignatureCheck verify_signatures(const CommandLine& line, const Arguments& arguments,
                                 Verification& verification) {
  std::optional<Studio> studio;
  if (line.has_studio()) studio = line.studio();
  SignatureCheck check = check_signatures({arguments.take}, studio ? &*studio : nullptr);
  const auto add = [](std::vector<std::string>& to, const std::vector<std::string>& lines) {
    to.insert(to.end(), lines.begin(), lines.end());
  };
  add(verification.disagreements, check.disagreements);
  add(verification.notes, check.notes);
  if (arguments.is_signed && !check.is_complete) {
    verification.disagreements.emplace_back(
        studio ? "not every node and file has a signature with a key of the studio file"
               : "cannot check signatures without a studio file with keys; try --studio");
  }
  return check;
}

void print_text(const Verification& verification) {
  print_lines(table_lines(verification.ledger));
  print_lines(problem_lines(verification.ledger));
  print_lines(verification.disagreements);
  for (const std::string& line : verification.notes) {
    std::printf("note: %s\n", printable(line).c_str());
  }
  std::printf("%s\n", verification.ledger.verdict().c_str());
}

void prepend_new_lines(std::vector<std::string> lines, std::vector<std::string>& to) {
  std::erase_if(lines,
                [&](const std::string& line) { return std::ranges::find(to, line) != to.end(); });
  to.insert(to.begin(), lines.begin(), lines.end());
}

// Marks the take as verified, which `takes delete` requires. A read-only folder is reported.
void save_result(const TakePaths& paths, const Verification& verification) {
  const io::Status saved = save_verified(paths, verification);
  if (!saved) note("v3dctl: verified, but cannot save the result: " + saved.error().message);
}

/// The result includes the disagreements and notes of the recovery, found before it wrote the
/// ledger and the indexes of logs.
Verification recover_and_verify(const TakePaths& paths) {
  load_take_info(paths);  // throws for a folder that is no take
  const auto locks = io::value_or_throw(lock_whole_take(paths));
  const Verification recovered = recover_take(paths, AfterReadErrors::kRecover);
  Verification verification = verify_take(paths, ReadFrom::kDisk);
  prepend_new_lines(recovered.disagreements, verification.disagreements);
  prepend_new_lines(recovered.notes, verification.notes);
  return verification;
}

int run(const CommandLine& line, const Arguments& arguments) {
  const TakePaths paths{arguments.take};
  Verification verification =
      arguments.recover ? recover_and_verify(paths) : verify_take(paths, ReadFrom::kDisk);
  ImageCheckResult images;
  if (arguments.images) {
    catch_interrupts();
    images = check_images({.take = arguments.take, .studio = line.studio_of_take(arguments.take)});
    for (std::string& text : fault_lines(images)) {
      verification.disagreements.push_back(std::move(text));
    }
  }
  const SignatureCheck signatures = verify_signatures(line, arguments, verification);
  if (arguments.json) {
    Json json = verification_json(verification);
    json["signatures"] = signatures_json(signatures);
    if (arguments.images) json["images"] = images_json(images);
    std::printf("%s\n", json.dump(2).c_str());
  } else {
    print_signers(signatures);
    print_text(verification);
  }
  if (verification.info.state == TakeState::kRecording) {
    note(
        "v3dctl: this take was not closed; when no process records into it: v3dctl verify "
        "--recover " +
        arguments.take.string());
    return kExitIncomplete;
  }
  save_result(paths, verification);
  return verification.whole() ? kExitDone : kExitIncomplete;
}

}  // namespace

void add_verify(CommandLine& line) {
  CLI::App* command =
      line.add("verify", "Check a take against its ledger, file by file",
               {"v3dctl verify kendo-07", "v3dctl verify kendo-07 --images --json"});
  auto arguments = std::make_shared<Arguments>();
  command->add_option("TAKE", arguments->take, "The folder of the take")->required();
  command->add_flag("--recover", arguments->recover,
                    "Close a take after a power cut or crash: write the ledger of its files");
  command->add_flag(
      "--images", arguments->images,
      "Also compare the silhouettes of each camera with the hull of the others: report "
      "cameras with a frame lag or displaced since the calibration");
  command->add_flag("--signed", arguments->is_signed,
                    "Fail unless every capture node of the take, and every file, has a signature "
                    "with a key of the studio file");
  add_json_flag(command, arguments->json);
  line.on_run(command, [&line, arguments] { return run(line, *arguments); });
}

}  // namespace v3d::ctl
