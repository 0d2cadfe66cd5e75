// skeleton: learns the kinematic structure of a take, or finds similar poses.
#include <fmt/core.h>

#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "base/core/error.h"
#include "base/core/text.h"
#include "base/io/file.h"
#include "common/console.h"
#include "v3dctl/command_line.h"
#include "v3dctl/options.h"
#include "v3dctl/skeleton/take_skeleton.h"

namespace v3d::ctl {
namespace {

using Json = nlohmann::ordered_json;

constexpr size_t kSimilar = 10;

struct Arguments {
  std::filesystem::path take, other, bvh, trc;
  std::string frames;
  int64_t like = -1;
  int performer = 1;
  bool json = false;
};

int find_similar(const Arguments& arguments) {
  const std::filesystem::path& other = arguments.other.empty() ? arguments.take : arguments.other;
  const std::vector<SimilarPose> found = similar_poses(
      arguments.take, arguments.like, other, parse_frame_range(arguments.frames), kSimilar);
  Json list = Json::array();
  for (const SimilarPose& pose : found) {
    list.push_back({{"pulse", pose.pulse}, {"similarity", pose.similarity}});
    if (!arguments.json) fmt::print("pulse {:>6}  {:.3f}\n", pose.pulse, pose.similarity);
  }
  if (arguments.json) fmt::print("{}\n", Json{{"like", arguments.like}, {"similar", list}}.dump(2));
  return kExitDone;
}

Json summary(const TakeSkeleton& skeleton) {
  const recon::KinematicStructure& structure = skeleton.structure;
  Json confidences = Json::object();
  for (size_t j = 0; j < recon::kBodyJoints; ++j) {
    double sum = 0;
    for (const recon::SkeletonPulse& pulse : structure.pulses) sum += pulse.confidence[j];
    confidences[std::string(recon::name(static_cast<recon::Joint>(j)))] =
        sum / static_cast<double>(structure.pulses.size());
  }
  return {{"pulses", skeleton.pulses.size()},
          {"skeletons", structure.pulses.size()},
          {"good_pulses", structure.good},
          {"start_pulse", skeleton.pulses[structure.start]},
          {"stature_m", structure.lengths.stature_m()},
          {"prop", structure.has_prop},
          {"mean_confidences", confidences},
          {"problems", skeleton.problems},
          {"graph_ms", skeleton.graph_ms}};
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

int run(const Arguments& arguments) {
  if (arguments.like >= 0) return find_similar(arguments);
  catch_interrupts();
  std::optional<Progress> progress;
  const TakeSkeleton skeleton = learn_skeleton(
      arguments.take, parse_frame_range(arguments.frames), arguments.performer,
      [&](int64_t pulses) { progress.emplace("skeleton", pulses); }, [&] { progress->advance(); });
  progress.reset();
  replace_file(arguments.take / file_name(arguments.performer), skeleton_json(skeleton));
  if (!arguments.bvh.empty()) replace_file(arguments.bvh, skeleton_bvh(skeleton));
  if (!arguments.trc.empty()) {
    replace_file(arguments.trc, skeleton_trc(skeleton, arguments.trc.filename().string()));
  }
  if (arguments.json) {
    fmt::print("{}\n", summary(skeleton).dump(2));
  } else {
    print_text(skeleton);
  }
  return skeleton.structure.pulses.size() == skeleton.pulses.size() ? kExitDone : kExitIncomplete;
}

}  // namespace

void add_skeleton(CommandLine& line) {
  cli::Command command =
      line.add("skeleton", "Learn the joints and bones of a performer (skeleton.json)",
               {"v3dctl skeleton dancer --bvh dancer.bvh --trc dancer.trc",
                "v3dctl skeleton dancer --like 120 --in rehearsal"});
  auto arguments = std::make_shared<Arguments>();
  command.add_option("TAKE", arguments->take, "The folder of a reconstructed take").required();
  add_frames_option(command, arguments->frames);
  command
      .add_option("--performer", arguments->performer,
                  "The performer, where v3dctl performers has labelled the take")
      .check(cli::integer_in(1, 255))
      .show_default();
  command.add_option("--bvh", arguments->bvh, "Also write the motion as a BVH file")
      .type_name("FILE");
  command.add_option("--trc", arguments->trc, "Also write the joints as a TRC file")
      .type_name("FILE");
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
