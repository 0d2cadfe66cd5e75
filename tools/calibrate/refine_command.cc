#include <algorithm>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "base/config/calib_file.h"
#include "base/core/error.h"
#include "base/geometry/rigid_transform.h"
#include "base/image/mask_operations.h"
#include "calib/rig/silhouette_refinement.h"
#include "calibrate/calibrate_commands.h"
#include "common/console.h"
#include "daemon/recorded/take_frames.h"
#include "recon/hull/voxel_grid.h"
#include "v3dctl/options.h"
#include "v3dctl/reconstruct/reconstruct_request.h"

namespace v3d::calibrate {
namespace {

using Json = nlohmann::ordered_json;

struct Arguments {
  std::string take;
  std::string calib;
  std::string out;
  int instants = 45;
  bool focal = false;
  bool json = false;
};

/// The file of the rig that is refined.
std::filesystem::path calib_path(const Arguments& arguments) {
  return arguments.calib.empty() ? take::TakePaths{arguments.take}.calib()
                                 : std::filesystem::path(arguments.calib);
}

/// Silhouettes of all cameras from frames spread over a take. They are clipped to the common view
/// of the cameras, and specks are removed.
class Silhouettes {
 public:
  Silhouettes(const Arguments& arguments, const Rig& rig) : take_(arguments.take, {}), rig_(rig) {
    require_common_cameras(arguments.calib);
    const Box space = space_of(arguments);
    for (const RigCamera& camera : rig) views_.push_back(recon::bounds_mask(space, camera.model));
    const std::vector<int64_t> pulses = take_.pulses();
    const size_t count = std::min<size_t>(static_cast<size_t>(arguments.instants), pulses.size());
    Progress progress("read silhouettes", static_cast<int64_t>(count));
    for (size_t i = 0; i < count; ++i) {
      ctl::stop_if_interrupted();
      read(pulses[i * pulses.size() / count]);
      progress.advance();
    }
  }

  std::vector<calib::SilhouetteSet> sets() const {
    std::vector<calib::SilhouetteSet> sets;
    for (const auto& instant : instants_) {
      sets.emplace_back();
      for (const auto& mask : instant) sets.back().push_back(mask ? &*mask : nullptr);
    }
    return sets;
  }

 private:
  /// Throws InputError where the take has none of the rig's cameras, or one with images of another
  /// size.
  void require_common_cameras(const std::string& calib) const {
    bool has_common = false;
    for (const RigCamera& camera : take_.rig()) {
      const int c = find_camera(rig_, camera.name);
      if (c < 0) continue;
      has_common = true;
      const ImageSize size = rig_[c].model.size();
      if (size == camera.model.size()) continue;
      throw InputError(camera.name + ": its images in the take are " +
                       format_size(camera.model.size()) + ", but " + calib + " calibrates it at " +
                       format_size(size));
    }
    if (!has_common) throw InputError(calib + ": has none of the cameras of the take");
  }

  /// The space of the take's studio file; without one, what the cameras see in common.
  /// Throws InputError where they see no space in common.
  Box space_of(const Arguments& arguments) const {
    const std::optional<Studio> studio = take::load_take_studio({arguments.take});
    if (studio) return studio->space.bounds;
    try {
      return ctl::default_bounds(rig_, ctl::default_min_views(static_cast<int>(rig_.size())));
    } catch (const InputError&) {  // its text is about options of other commands
      throw InputError(calib_path(arguments).string() +
                       ": its cameras see no space in common, and the take has no studio file with "
                       "[space]; check the calibration");
    }
  }

  void read(int64_t pulse) {
    constexpr int kSpeck = 2;  // pixels
    const auto frames = take_.read(pulse);
    std::vector<std::optional<Mask>> masks(rig_.size());
    for (size_t i = 0; i < frames.size(); ++i) {
      const int camera = find_camera(rig_, take_.rig()[i].name);
      if (!frames[i] || camera < 0) continue;
      masks[camera] = open(intersection_of(frames[i]->mask, views_[camera]), kSpeck);
    }
    instants_.push_back(std::move(masks));
  }

  recorded::TakeFrames take_;
  const Rig& rig_;
  std::vector<Mask> views_;
  std::vector<std::vector<std::optional<Mask>>> instants_;
};

Json to_json(const Rig& rig, const calib::RefineResult& result) {
  Json cameras = Json::array();
  for (size_t i = 0; i < rig.size(); ++i) {
    const calib::RefinedCamera& c = result.cameras[i];
    cameras.push_back({{"name", rig[i].name},
                       {"before_px", c.before_px},
                       {"after_px", c.after_px},
                       {"moved_px", c.moved_px},
                       {"tangents", c.tangents}});
  }
  return {{"better", result.better},
          {"before_px", result.before_px},
          {"after_px", result.after_px},
          {"cameras", cameras}};
}

void print_text(const Rig& rig, const calib::RefineResult& result, const std::string& out) {
  size_t widest = 0;
  for (const RigCamera& camera : rig) widest = std::max(widest, camera.name.size());
  for (size_t i = 0; i < rig.size(); ++i) {
    const calib::RefinedCamera& c = result.cameras[i];
    if (c.tangents == 0) {
      std::printf("%-*s  not refined: no tangent in common with another camera\n",
                  static_cast<int>(widest), rig[i].name.c_str());
      continue;
    }
    std::printf("%-*s  silhouette error %.2f px before, %s %.2f px; image shift %s %.2f px\n",
                static_cast<int>(widest), rig[i].name.c_str(), c.before_px,
                result.better ? "after" : "at best", c.after_px, result.better ? "is" : "would be",
                c.moved_px);
  }
  if (result.better) {
    std::printf("refined: %.2f px before, %.2f px after, in held-out frames; wrote %s\n",
                result.before_px, result.after_px, out.c_str());
  } else {
    std::printf(
        "not refined: the change from %.2f to %.2f px in held-out frames is not significant; wrote "
        "%s, unchanged\n",
        result.before_px, result.after_px, out.c_str());
  }
}

int run(const Arguments& arguments) {
  ctl::check_output({"--out", arguments.out});
  const Rig rig = arguments.calib.empty() ? take::load_take_calib({arguments.take})
                                          : load_calib(arguments.calib);
  if (rig.size() < 2) {
    throw InputError(calib_path(arguments).string() +
                     ": has one camera; refine compares silhouettes of at least two");
  }
  ctl::catch_interrupts();
  const Silhouettes silhouettes(arguments, rig);
  const calib::RefineResult result =
      calib::refine_by_silhouettes(rig, silhouettes.sets(), {.focal_lengths = arguments.focal});
  save_result(arguments.out, result.rig);
  if (arguments.json) {
    std::printf("%s\n", to_json(rig, result).dump(2).c_str());
  } else {
    print_text(rig, result, arguments.out);
  }
  return kExitDone;
}

}  // namespace

void add_refine(ctl::CommandLine& line, cli::Command calibrate) {
  cli::Command command =
      add_under(calibrate, "refine", "Refine the camera poses by the silhouettes of a take",
                {"v3dctl calibrate refine --take kendo-07 --out calib.toml"});
  auto arguments = std::make_shared<Arguments>();
  command
      .add_option("--take", arguments->take,
                  "A take in which a person moves and all cameras see the person")
      .type_name("TAKE")
      .required();
  command.add_option("--calib", arguments->calib, "The calibrated rig (default: that of the take)")
      .type_name("FILE");
  command
      .add_option("--out", arguments->out,
                  "The file to write: the refined rig, or the unchanged one where the error does "
                  "not fall clearly")
      .type_name("FILE")
      .required();
  command.add_option("--instants", arguments->instants, "Number of frames to use")
      .type_name("N")
      .check(cli::integer_in(6, 1000))
      .show_default();
  command.add_flag("--focal", arguments->focal, "Also refine the focal lengths");
  ctl::add_json_flag(command, arguments->json);
  line.on_run(command, [arguments] { return run(*arguments); });
}

}  // namespace v3d::calibrate
