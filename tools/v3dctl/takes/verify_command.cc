// verify: checks a take against its ledger, signatures and, on request, its images.
#include <fmt/core.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cstdio>
#include <deque>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <vector>

#include "base/config/studio_file.h"
#include "base/core/error.h"
#include "base/core/text.h"
#include "base/geometry/rigid_transform.h"
#include "base/image/mask_operations.h"
#include "common/console.h"
#include "daemon/recorded/take_frames.h"
#include "recon/hull/voxel_grid.h"
#include "recon/silhouettes/displaced_camera.h"
#include "recon/silhouettes/frame_lag.h"
#include "recon/silhouettes/leave_one_out_hull.h"
#include "take/ledger/signature_check.h"
#include "take/ledger/take_account.h"
#include "take/ledger/verify.h"
#include "take/take_lock.h"
#include "v3dctl/command_line.h"
#include "v3dctl/operate/reply_text.h"
#include "v3dctl/options.h"
#include "v3dctl/reconstruct/reconstruct_request.h"
#include "v3dctl/takes/named_takes.h"

namespace v3d::ctl {

// Image check of a take: frame lag and displacement of each camera, from its silhouettes.

struct ImageCheckRequest {
  std::filesystem::path take;
  std::optional<Studio> studio;  ///< gives the bounds if the take belongs to this studio
  int pulses = 50;               ///< number to compare, evenly spread over the take
};

/// Both lists have one entry for each camera.
struct ImageCheckResult {
  std::vector<recon::CameraSync> frame_lags;
  std::vector<recon::CameraDisplacement> displacements;
};

/// Compares the silhouettes of each camera with its leave-one-out hull, at its own and at
/// neighbouring pulses.
/// Throws InputError without a calibration, for frames with neither mask nor background model, and
/// for a take with too few pulses. Uses all processors.
ImageCheckResult check_images(const ImageCheckRequest& request);

/// A line for each camera with a frame lag. Without any, a line for each displaced camera: a lag
/// shifts silhouettes too.
std::vector<std::string> fault_lines(const ImageCheckResult& result);

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
    const recon::CameraSync& lag = result.frame_lags[i];
    const recon::CameraDisplacement& displacement = result.displacements[i];
    list.push_back({{"name", lag.camera},
                    {"pulses_late", lag.pulses_late()},
                    {"frames", lag.frames},
                    {"disagreement", lag.disagreement},
                    {"displaced", displacement.displaced},
                    {"shift_px", {displacement.shift.x(), displacement.shift.y()}}});
  }
  return list;
}

Json verification_json(const take::Verification& verification) {
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

Json signatures_json(const take::SignatureCheck& check) {
  Json list = Json::array();
  for (const take::SignedBy& signer : check.signers) {
    list.push_back({{"node", signer.node},
                    {"public_key", signer.key.text()},
                    {"known", signer.is_known},
                    {"occasion", name(signer.occasion)},
                    {"files", signer.files}});
  }
  return {{"complete", check.is_complete}, {"signers", std::move(list)}};
}

/// Says when a signature was made, if not at the stop of the take; otherwise empty.
const char* occasion_text(take::SigningOccasion occasion) {
  if (occasion == take::SigningOccasion::kRecovery)
    return "; signed after a recovery, not at the stop";
  if (occasion == take::SigningOccasion::kCommand) return "; signed by a command, not at the stop";
  return "";
}

void print_signers(const take::SignatureCheck& check) {
  for (const take::SignedBy& signer : check.signers) {
    std::printf("signed by %s, key %s%s: %s files match%s\n", signer.node.c_str(),
                signer.key.text().c_str(), signer.is_known ? "" : " (not in the studio file)",
                format_count(signer.files).c_str(), occasion_text(signer.occasion));
  }
}

/// Adds disagreements and notes to `verification`.
take::SignatureCheck verify_signatures(const CommandLine& line, const Arguments& arguments,
                                       take::Verification& verification) {
  std::optional<Studio> studio;
  if (line.has_studio()) studio = line.studio();
  take::SignatureCheck check =
      take::check_signatures({arguments.take}, studio ? &*studio : nullptr);
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

void print_text(const take::Verification& verification) {
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
// `of_files`: the number of disagreements that the check of the files found.
void save_result(const take::TakePaths& paths, const take::Verification& verification,
                 size_t of_files) {
  const auto& disagreements = verification.disagreements;
  const std::string other = disagreements.size() > of_files ? disagreements[of_files] : "";
  const io::Status saved = save_verified(paths, verification, printable(other));
  if (!saved) note("v3dctl: verified, but cannot save the result: " + saved.error().message);
}

/// The result includes the disagreements and notes of the recovery, found before it wrote the
/// ledger and the indexes of logs.
take::Verification recover_and_verify(const take::TakePaths& paths) {
  load_take_info(paths);  // throws for a folder that is no take
  const auto locks = io::value_or_throw(lock_whole_take(paths));
  const take::Verification recovered = recover_take(paths, take::AfterReadErrors::kRecover);
  take::Verification verification = verify_take(paths, take::ReadFrom::kDisk);
  prepend_new_lines(recovered.disagreements, verification.disagreements);
  prepend_new_lines(recovered.notes, verification.notes);
  return verification;
}

int run(const CommandLine& line, const Arguments& arguments) {
  const take::TakePaths paths{arguments.take};
  if (take::is_edited(paths)) {
    throw InputError(
        arguments.take.string() +
        ": is an edited take without a recording; verify the take that it was made of");
  }
  take::Verification verification =
      arguments.recover ? recover_and_verify(paths) : verify_take(paths, take::ReadFrom::kDisk);
  const size_t of_files = verification.disagreements.size();
  ImageCheckResult images;
  if (arguments.images) {
    catch_interrupts();
    images = check_images({.take = arguments.take, .studio = line.studio_of_take(arguments.take)});
    for (std::string& text : fault_lines(images)) {
      verification.disagreements.push_back(std::move(text));
    }
  }
  const take::SignatureCheck signatures = verify_signatures(line, arguments, verification);
  if (arguments.json) {
    Json json = verification_json(verification);
    json["signatures"] = signatures_json(signatures);
    if (arguments.images) json["images"] = images_json(images);
    std::printf("%s\n", json.dump(2).c_str());
  } else {
    print_signers(signatures);
    print_text(verification);
  }
  if (verification.info.state == take::TakeState::kRecording) {
    note(
        "v3dctl: this take was not closed; when no process records into it: v3dctl verify "
        "--recover " +
        arguments.take.string());
    return kExitIncomplete;
  }
  save_result(paths, verification, of_files);
  return verification.whole() ? kExitDone : kExitIncomplete;
}

}  // namespace

void add_verify(CommandLine& line) {
  cli::Command command =
      line.add("verify", "Check a take against its ledger, file by file",
               {"v3dctl verify kendo-07", "v3dctl verify kendo-07 --images --json"});
  auto arguments = std::make_shared<Arguments>();
  command.add_option("TAKE", arguments->take, "The folder of the take").required();
  command.add_flag("--recover", arguments->recover,
                   "Close a take after a power cut or crash: write the ledger of its files");
  command.add_flag(
      "--images", arguments->images,
      "Also compare the silhouettes of each camera with the hull of the others: report "
      "cameras with a frame lag or displaced since the calibration");
  command.add_flag("--signed", arguments->is_signed,
                   "Fail unless every capture node of the take, and every file, has a signature "
                   "with a key of the studio file");
  add_json_flag(command, arguments->json);
  line.on_run(command, [&line, arguments] { return run(line, *arguments); });
}

namespace {

/// Masks of all cameras at one pulse, limited to the view of the bounds.
struct Silhouettes {
  int64_t pulse = 0;
  std::vector<std::optional<Mask>> masks;
};

class ImageCheck {
 public:
  explicit ImageCheck(const ImageCheckRequest& request)
      : take_(request.take, {}),
        bounds_(bounds_of(request)),
        hulls_(take_.rig(), bounds_, recon::voxel_for_silhouettes(take_.rig(), bounds_),
               default_min_views(static_cast<int>(take_.rig().size()))),
        frame_lags_(take_.rig()),
        displacements_(take_.rig()),
        views_(take_.rig().size()),
        pulses_(evenly_spread(take_.pulses(), request)),
        progress_("check images", std::ssize(pulses_)) {
    tbb::parallel_for(size_t{0}, views_.size(), [&](size_t i) {
      views_[i] = recon::bounds_mask(bounds_, take_.rig()[i].model);
    });
  }

  ImageCheckResult run() {
    for (const int64_t pulse : pulses_) {
      stop_if_interrupted();
      move_window_to(pulse);
      add(windows());
      progress_.advance();
    }
    return {frame_lags_.result(), displacements_.result(hulls_)};
  }

 private:
  void add(const std::vector<recon::MaskWindow>& windows) {
    std::vector<const Mask*> masks;
    for (const recon::MaskWindow& window : windows) masks.push_back(window[recon::kMaxPulsesOff]);
    const std::vector<Mask> expected = hulls_.silhouettes_of_each(masks);
    frame_lags_.add(windows, expected);
    displacements_.add(masks, expected);
  }

  Box bounds_of(const ImageCheckRequest& request) const {
    if (request.studio && request.studio->name == take_.info().studio) {
      return request.studio->space.bounds;
    }
    return default_bounds(take_.rig(), default_min_views(static_cast<int>(take_.rig().size())));
  }

  /// Pulses to compare; each has kMaxPulsesOff neighbours on both sides.
  static std::vector<int64_t> evenly_spread(const std::vector<int64_t>& all,
                                            const ImageCheckRequest& request) {
    const int64_t usable = std::ssize(all) - 2 * recon::kMaxPulsesOff;
    if (usable < 1) {
      throw InputError(request.take.string() +
                       ": has too few pulses to compare cameras; expected at least " +
                       std::to_string(recon::kShifts));
    }
    const int64_t wanted = std::min<int64_t>(request.pulses, usable);
    std::vector<int64_t> pulses;
    for (int64_t i = 0; i < wanted; ++i) {
      pulses.push_back(all[static_cast<size_t>(recon::kMaxPulsesOff + i * usable / wanted)]);
    }
    return pulses;
  }

  /// Reads only pulses after the last one of the window: sequential reading is cheap.
  void move_window_to(int64_t pulse) {
    while (!window_.empty() && window_.front().pulse < pulse - recon::kMaxPulsesOff)
      window_.pop_front();
    int64_t next = window_.empty() ? pulse - recon::kMaxPulsesOff : window_.back().pulse + 1;
    for (; next <= pulse + recon::kMaxPulsesOff; ++next) window_.push_back(read(next));
  }

  Silhouettes read(int64_t pulse) {
    Silhouettes result{.pulse = pulse, .masks = {}};
    const auto frames = take_.read(pulse);
    for (size_t i = 0; i < frames.size(); ++i) {
      const bool usable = frames[i] && frames[i]->mask.size() == views_[i].size();
      result.masks.push_back(usable ? std::optional(intersection_of(frames[i]->mask, views_[i]))
                                    : std::nullopt);
    }
    return result;
  }

  std::vector<recon::MaskWindow> windows() const {
    std::vector<recon::MaskWindow> windows(views_.size());
    for (size_t shift = 0; shift < recon::kShifts; ++shift) {
      for (size_t camera = 0; camera < views_.size(); ++camera) {
        const std::optional<Mask>& mask = window_[shift].masks[camera];
        windows[camera][shift] = mask ? &*mask : nullptr;
      }
    }
    return windows;
  }

  recorded::TakeFrames take_;
  const Box bounds_;
  recon::LeaveOneOutHull hulls_;
  recon::SyncCheck frame_lags_;
  recon::DisplacementMeter displacements_;
  std::vector<Mask> views_;
  const std::vector<int64_t> pulses_;
  std::deque<Silhouettes> window_;
  Progress progress_;
};

std::string frame_lag_text(const recon::CameraSync& camera) {
  const int late = camera.pulses_late();
  const int best = recon::kMaxPulsesOff + late;
  const std::string text = fmt::format(
      "frame lag, {} {}: its silhouettes differ from the hull of the other cameras by "
      "{:.1f} % of their pixels, and by {:.1f} % with the lag corrected",
      count_of(std::abs(late), "pulse"), late > 0 ? "late" : "early",
      100 * camera.disagreement[recon::kMaxPulsesOff],
      100 * camera.disagreement[static_cast<size_t>(best)]);
  return camera.camera + ": " + text;
}

}  // namespace

ImageCheckResult check_images(const ImageCheckRequest& request) {
  return ImageCheck(request).run();
}

std::vector<std::string> fault_lines(const ImageCheckResult& result) {
  std::vector<std::string> lines;
  for (const recon::CameraSync& camera : result.frame_lags) {
    if (camera.pulses_late() != 0) lines.push_back(frame_lag_text(camera));
  }
  // A frame lag shifts silhouettes, too.
  if (!lines.empty()) return lines;
  for (const recon::CameraDisplacement& camera : result.displacements) {
    if (!camera.displaced) continue;
    lines.push_back(camera.camera + ": " + text_of(camera) + "; calibrate it again");
  }
  return lines;
}

}  // namespace v3d::ctl
