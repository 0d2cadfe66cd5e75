// skeleton: learns the kinematic structure of a take, or finds similar poses.
#include <fmt/core.h>

#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "base/core/error.h"
#include "base/core/text.h"
#include "base/io/file.h"
#include "common/console.h"
#include "common/partial_file.h"
#include "v3dctl/command_line.h"
#include "v3dctl/export/mesh_export.h"
#include "v3dctl/options.h"
#include "v3dctl/skeleton/take_skeleton.h"

namespace v3d::ctl {
namespace {

using Json = nlohmann::ordered_json;

constexpr size_t kSimilar = 10;

struct Arguments {
  std::filesystem::path take, out, other, truth;
  std::string frames, format;
  int64_t like = -1;
  int performer = 1;
  int atlas_side = 0;
  bool json = false;
};

int find_similar(const Arguments& arguments) {
  const std::filesystem::path& other = arguments.other.empty() ? arguments.take : arguments.other;
  const SimilarPoseList found = similar_poses(arguments.take, arguments.like, other,
                                              parse_frame_range(arguments.frames), kSimilar);
  Json list = Json::array();
  for (const SimilarPose& pose : found.poses) {
    list.push_back({{"pulse", pose.pulse}, {"similarity", pose.similarity}});
    if (!arguments.json) fmt::print("pulse {:>6}  {:.3f}\n", pose.pulse, pose.similarity);
  }
  if (arguments.json) fmt::print("{}\n", Json{{"like", arguments.like}, {"similar", list}}.dump(2));
  int status = kExitDone;
  for (const std::filesystem::path& file : found.unfinished) status = report_missing_index(file);
  return status;
}

Json to_json(const JointError& error) { return {{"p50", error.p50_mm}, {"p90", error.p90_mm}}; }

Json summary(const TakeSkeleton& skeleton) {
  const recon::KinematicStructure& structure = skeleton.structure;
  Json confidences = Json::object();
  for (size_t j = 0; j < recon::kBodyJoints; ++j) {
    double sum = 0;
    for (const recon::SkeletonPulse& pulse : structure.pulses) sum += pulse.confidence[j];
    confidences[std::string(recon::name(static_cast<recon::Joint>(j)))] =
        sum / static_cast<double>(structure.pulses.size());
  }
  Json json{{"joints", structure.has_prop ? recon::kJoints : recon::kBodyJoints},
            {"pulses", skeleton.pulses.size()},
            {"skeletons", structure.pulses.size()},
            {"bone_length_spread", bone_length_spread(skeleton)},
            {"good_pulses", structure.good},
            {"start_pulse", skeleton.pulses[structure.start]},
            {"stature_m", structure.lengths.stature_m()},
            {"prop", structure.has_prop},
            {"mean_confidences", confidences},
            {"problems", skeleton.problems},
            {"graph_ms", skeleton.graph_ms}};
  const SkinError error = skin_error(skeleton.tracked, skeleton.skins);
  json["tracked_pulses"] = error.pulses;
  if (error.pulses > 0) json["skin_error_mm"] = {{"p50", error.p50_mm}, {"p90", error.p90_mm}};
  return json;
}

void put_error(Json& json, const SkeletonError& error) {
  json["joint_error_mm"] = to_json(error.all);
  json["swaps"] = error.swaps;
  json["compared_pulses"] = error.pulses;
  for (const auto& [joint, of_joint] : error.of_joint) {
    json["error_of_joint_mm"][joint] = to_json(of_joint);
  }
}

void print_text(const TakeSkeleton& skeleton) {
  const recon::KinematicStructure& structure = skeleton.structure;
  fmt::print("{} of {} have a skeleton; head, feet and hands are free in {}\n",
             format_count(std::ssize(structure.pulses)),
             count_of(std::ssize(skeleton.pulses), "pulse"),
             format_count(static_cast<int64_t>(structure.good)));
  fmt::print("stature      {:.2f} m{}\n", structure.lengths.stature_m(),
             structure.has_prop
                 ? fmt::format(", with a prop of {:.2f} m",
                               structure.lengths.between(recon::kPropBase, recon::kPropTip))
                 : std::string());
  for (const std::string& problem : skeleton.problems) fmt::print("{}\n", problem);
}

std::string file_name(int performer) {
  if (performer == 1) return "skeleton.json";
  return "skeleton.performer" + std::to_string(performer) + ".json";
}

void require_similarity_options(const Arguments& arguments) {
  if (arguments.format.empty() && arguments.out.empty() && arguments.atlas_side == 0 &&
      arguments.truth.empty() && arguments.performer == 1) {
    return;
  }
  throw InputError(
      "--like only lists pulses, of the whole surface: OUT, --export, --atlas, --truth and "
      "--performer are for a skeleton");
}

/// The content of OUT; empty without --export. `incomplete`: the pulses whose textures lack frames
/// of cameras. Throws InputError as skeleton_glb() and TexturePainter do.
std::string exported(const Arguments& arguments, const TakeSkeleton& skeleton,
                     int64_t& incomplete) {
  if (arguments.format == "bvh") return skeleton_bvh(skeleton);
  if (arguments.format == "trc") return skeleton_trc(skeleton, arguments.out.filename().string());
  if (arguments.format != "glb") return {};
  std::vector<recon::TextureAtlas> textures;
  if (arguments.atlas_side > 0) {
    TexturePainter painter(arguments.take, "--atlas");
    textures = skin_textures(skeleton, painter, arguments.atlas_side);
    incomplete = painter.incomplete();
  }
  return skeleton_glb(skeleton, normal_folder(arguments.take).filename().string(), textures);
}

/// Writes OUT, then skeleton.json, which stays as it is when OUT cannot be written.
void write_files(const Arguments& arguments, const TakeSkeleton& skeleton, const std::string& out) {
  if (!arguments.format.empty()) replace_file(arguments.out, out);
  replace_file(arguments.take / file_name(arguments.performer),
               skeleton_json(skeleton, arguments.frames.empty()));
}

/// Has every pulse a skeleton, which at least one shows well?
bool is_whole(const TakeSkeleton& skeleton) {
  return skeleton.structure.pulses.size() == skeleton.pulses.size() && skeleton.structure.good > 0;
}

/// Before the skeleton, which can take many minutes. Throws InputError where OUT could not be
/// written, or the skeleton not be exported or compared, after it.
void check_files(const Arguments& arguments) {
  check_output({"OUT", arguments.out});
  const take::TakePaths paths{arguments.take};
  if (arguments.format == "glb" && !file_exists(paths.motion())) {
    take::load_take_info(paths);  // throws if the folder is not a take
    throw InputError("--export glb needs a tracked surface: run v3dctl track first");
  }
  if (!arguments.truth.empty()) require_true_joints(arguments.truth, arguments.performer);
}

int run(const Arguments& arguments) {
  if (arguments.like >= 0) {
    require_similarity_options(arguments);
    return find_similar(arguments);
  }
  if (arguments.format.empty() != arguments.out.empty()) {
    throw InputError("--export bvh|glb|trc and OUT, its file, are given together");
  }
  if (arguments.atlas_side > 0 && arguments.format != "glb") {
    throw InputError("--atlas: expected --export glb");
  }
  check_files(arguments);
  catch_interrupts();
  std::optional<Progress> progress;
  const TakeSkeleton skeleton = learn_skeleton(
      arguments.take, parse_frame_range(arguments.frames), arguments.performer,
      [&](int64_t pulses) { progress.emplace("skeleton", pulses); }, [&] { progress->advance(); });
  progress.reset();
  // A command that is refused replaces no file.
  int64_t incomplete = 0;
  const std::string out = exported(arguments, skeleton, incomplete);
  std::optional<SkeletonError> error;
  if (!arguments.truth.empty()) {
    error = compare_with_truth(skeleton, arguments.truth, arguments.performer);
  }
  stop_if_interrupted();
  write_files(arguments, skeleton, out);
  if (arguments.json) {
    Json json = summary(skeleton);
    if (error) put_error(json, *error);
    fmt::print("{}\n", json.dump(2));
  } else {
    print_text(skeleton);
    if (error) {
      fmt::print(
          "joints       {:.0f} mm (median), {:.0f} mm (90 %) from the true ones; left and right "
          "exchanged in {}\n",
          error->all.p50_mm, error->all.p90_mm, count_of(error->swaps, "pulse"));
    }
  }
  int status = report_incomplete_frames(incomplete, arguments.take);
  if (skeleton.is_unfinished) {
    status = report_missing_index(take::TakePaths{arguments.take}.mesh());
  }
  return is_whole(skeleton) ? status : kExitIncomplete;
}

}  // namespace

void add_skeleton(CommandLine& line) {
  cli::Command command = line.add(
      "skeleton", "Learn the joints and bones of a performer (skeleton.json)",
      {"v3dctl skeleton dancer --export bvh dancer.bvh", "v3dctl skeleton sim-01 --truth truth",
       "v3dctl skeleton dancer --like 120 --in rehearsal"});
  auto arguments = std::make_shared<Arguments>();
  command.add_option("TAKE", arguments->take, "The folder of a reconstructed take").required();
  command.add_option("OUT", arguments->out, "With --export: the file");
  add_frames_option(command, arguments->frames);
  command
      .add_option("--performer", arguments->performer,
                  "The performer, where v3dctl performers has labelled the take")
      .check(cli::integer_in(1, 255))
      .show_default();
  command
      .add_option("--export", arguments->format,
                  "Also write OUT: the motion (bvh), with the surface and its skin (glb), or the "
                  "places of the joints (trc)")
      .type_name("bvh|glb|trc")
      .check(cli::one_of({"bvh", "glb", "trc"}));
  command
      .add_option(
          "--atlas", arguments->atlas_side,
          "With --export glb: the side of a texture from the take's raw frames, in place of "
          "colours of vertices")
      .type_name("TEXELS")
      .check(cli::integer_in(recon::kMinAtlasSide, recon::kMaxAtlasSide));
  command
      .add_option("--truth", arguments->truth,
                  "Compare with the true joints of v3d-sim take --truth DIR")
      .type_name("DIR");
  const cli::Option like =
      command
          .add_option("--like", arguments->like,
                      "Instead list the pulses whose poses are most similar to this one")
          .type_name("PULSE")
          .check(cli::integer_in(0, take::kMaxPulses));
  command.add_option("--in", arguments->other, "With --like: search this take instead")
      .type_name("TAKE")
      .needs(like);
  add_json_flag(command, arguments->json);
  line.on_run(command, [arguments] { return run(*arguments); });
}

}  // namespace v3d::ctl
