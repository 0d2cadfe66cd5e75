#include <algorithm>
#include <array>
#include <optional>
#include <string_view>
#include <utility>
#include <vector>

#include "base/core/error.h"
#include "base/core/text.h"
#include "base/io/file.h"
#include "codec/motion_codec.h"
#include "common/console.h"
#include "common/partial_file.h"
#include "recon/motion/segment_plan.h"
#include "recon/pipeline/compact_frame.h"
#include "take/take.h"
#include "v3dctl/edit/editor.h"
#include "v3dctl/skeleton/take_skeleton.h"

namespace v3d::ctl {
namespace {

namespace fs = std::filesystem;

/// All that an edited take contains. edit.json shows that the folder holds no recording.
constexpr std::array<std::string_view, 5> kFiles{"edit.json", "calib.toml", "motion.v3d",
                                                 "skeleton.json", "take.toml"};

/// The name of the take in a folder.
std::string name_of(const fs::path& folder) { return normal_folder(folder).filename(); }

/// Frames for the lost pulses between the last frame and `next`, which is `step` pulses later.
void fill(recon::Clip& clip, const recon::ClipFrame& next, int64_t step) {
  const size_t last = clip.frames.size() - 1;
  for (int64_t n = 1; n < step; ++n) {
    const double share = static_cast<double>(n) / static_cast<double>(step);
    clip.frames.push_back(recon::frame_between(clip, clip.frames[last], next, share));
  }
}

/// Throws InputError for more lost pulses in a row inside a segment than the tracker leaves there.
/// A damaged file could have any number of them, and each becomes a frame.
void require_near_pulses(const fs::path& take, const std::vector<recon::TrackedBody>& bodies) {
  for (const recon::TrackedBody& body : bodies) {
    for (size_t p = 1; p < body.pulses.size(); ++p) {
      const int64_t before = body.pulses[p - 1], after = body.pulses[p];
      if (after - before <= recon::kMaxPulseStep) continue;
      throw InputError(take::TakePaths{take}.motion().string() + ": pulse " +
                       std::to_string(after) + " follows pulse " + std::to_string(before) +
                       " in a segment; expected at most " +
                       std::to_string(recon::kMaxPulseStep - 1) +
                       " lost pulses between them: run v3dctl track again");
    }
  }
}

/// motion.v3d of a clip. The encoder renumbers vertices, for instance those of a mirrored surface.
struct MotionFile {
  std::string bytes;
  std::vector<std::vector<uint32_t>> orders;  ///< [segment][vertex of the file]: vertex of the clip
};

/// Successive frames of one surface are a segment.
MotionFile motion_file(const recon::Clip& clip, const fs::path& out) {
  const std::vector<uint8_t> header = codec::MotionWriter::header();
  MotionFile file;
  file.bytes.assign(header.begin(), header.end());
  codec::MotionWriter writer({});
  for (size_t f = 0; f < clip.frames.size();) {
    stop_if_interrupted();
    const size_t surface = clip.frames[f].surface;
    codec::MotionSegment segment;
    for (const auto& [a, b, c] : clip.surfaces[surface].triangles) {
      segment.triangles.push_back({a, b, c});
    }
    for (; f < clip.frames.size() && clip.frames[f].surface == surface; ++f) {
      const recon::ClipFrame& frame = clip.frames[f];
      segment.pulses.push_back(static_cast<int64_t>(f));
      auto& positions = segment.positions.emplace_back();
      for (const Eigen::Vector3f& position : frame.positions) {
        positions.push_back({position.x(), position.y(), position.z()});
      }
      if (!frame.colours.empty()) segment.colours.push_back(recon::vertex_colours(frame.colours));
    }
    auto encoded = writer.add(segment);
    if (!encoded) {
      const std::string before = out.string() + ": the surface before frame " + std::to_string(f);
      throw InputError(before +
                       (writer.is_full()
                            ? " does not fit into motion.v3d, of which programs read at most 1 GiB "
                              "and 65,536 segments; expected a shorter action"
                            : " exceeds the limits of motion.v3d (docs/motion-format.md)"));
    }
    file.bytes.append(encoded->bytes.begin(), encoded->bytes.end());
    file.orders.push_back(std::move(encoded->order));
  }
  return file;
}

/// The skin for the vertices of a segment. `order`: one of MotionFile::orders.
recon::Skin renumbered(const recon::Skin& skin, const std::vector<uint32_t>& order) {
  recon::Skin result;
  result.rest = skin.rest;
  for (const uint32_t vertex : order) result.influences.push_back(skin.influences[vertex]);
  return result;
}

/// The runs of frames that motion_file() writes as segments, each with the skin of its surface.
void add_skins(const recon::Clip& clip, const MotionFile& motion, TakeSkeleton& skeleton) {
  std::optional<size_t> last;
  for (size_t f = 0; f < clip.frames.size(); ++f) {
    const size_t surface = clip.frames[f].surface;
    if (surface != last) {
      const std::vector<uint32_t>& order = motion.orders[skeleton.tracked.size()];
      skeleton.tracked.emplace_back();
      skeleton.skins.push_back(renumbered(clip.surfaces[surface].skin, order));
      last = surface;
    }
    skeleton.tracked.back().pulses.push_back(static_cast<int64_t>(f));
  }
}

/// skeleton.json of an edited clip, whose surfaces are in `motion`.
std::string skeleton_file(const TakeClip& edited, const MotionFile& motion) {
  TakeSkeleton skeleton;
  skeleton.rate_hz = edited.clip.rate_hz;
  skeleton.structure.lengths = edited.lengths;
  skeleton.structure.has_prop = edited.has_prop;
  skeleton.structure.prop_hand = edited.clip.prop_hand;
  for (size_t f = 0; f < edited.clip.frames.size(); ++f) {
    skeleton.pulses.push_back(static_cast<int64_t>(f));
    skeleton.structure.pulses.push_back(edited.clip.frames[f].skeleton);
    skeleton.structure.pulses.back().index = f;
  }
  add_skins(edited.clip, motion, skeleton);
  return skeleton_json(skeleton);
}

}  // namespace

void check_output(const fs::path& out) {
  if (!is_file_name(name_of(out))) {
    throw InputError(out.string() + ": '" + name_of(out) +
                     "' cannot name a take; choose another OUT: " + std::string(kFileNameRule));
  }
  if (!file_exists(out)) return;
  const std::vector<fs::path> entries = io::value_or_throw(io::list_folder(out));
  const auto is_ours = [](const fs::path& entry) {
    return std::ranges::find(kFiles, entry.filename().string()) != kFiles.end();
  };
  const bool is_edited = std::ranges::any_of(
      entries, [](const fs::path& entry) { return entry.filename() == kFiles.front(); });
  if (entries.empty() || (is_edited && std::ranges::all_of(entries, is_ours))) return;
  throw InputError(out.string() + ": holds something else than an edited take; choose another OUT");
}

recon::Clip clip_of(TakeSkeleton skeleton) {
  recon::Clip clip;
  clip.rate_hz = skeleton.rate_hz > 0 ? skeleton.rate_hz : 25;
  clip.prop_hand = skeleton.structure.prop_hand;
  int64_t last = -1;
  for (size_t b = 0; b < skeleton.tracked.size(); ++b) {
    recon::TrackedBody& body = skeleton.tracked[b];
    if (skeleton.skins[b].influences.empty()) continue;
    if (body.pulses.front() == last) clip.frames.pop_back();
    const std::vector<recon::SkeletonPulse> poses = std::move(skeleton.skins[b].poses);
    clip.surfaces.push_back({body.surface.triangles, std::move(skeleton.skins[b])});
    for (size_t p = 0; p < body.pulses.size(); ++p) {
      recon::ClipFrame frame{.surface = clip.surfaces.size() - 1,
                             .positions = std::move(body.positions[p]),
                             .colours = std::move(body.colours[p]),
                             .skeleton = poses[p]};
      if (p > 0) fill(clip, frame, body.pulses[p] - body.pulses[p - 1]);
      clip.frames.push_back(std::move(frame));
    }
    last = body.pulses.back();
  }
  return clip;
}

TakeClip read_clip(const fs::path& take, const std::function<void(int64_t)>& on_begin,
                   const std::function<void()>& on_pulse) {
  if (!file_exists(take::TakePaths{take}.motion())) {
    take::load_take_info({take});  // throws if the folder is not a take
    throw InputError(take.string() + ": has no tracked surface: run v3dctl track first");
  }
  TakeSkeleton skeleton = learn_skeleton(take, {}, 1, on_begin, on_pulse);
  require_near_pulses(take, skeleton.tracked);
  TakeClip result;
  result.has_prop = skeleton.structure.has_prop;
  result.problems = std::move(skeleton.problems);
  result.has_good_pulse = skeleton.structure.good > 0;
  result.is_unfinished = skeleton.is_unfinished;
  result.lengths = skeleton.structure.lengths;
  const int64_t pulses = skeleton.pulses.back() - skeleton.pulses.front() + 1;
  result.clip = clip_of(std::move(skeleton));
  if (result.clip.frames.empty()) {
    throw InputError(take.string() +
                     ": has no tracked segment of three pulses with a skeleton of one performer");
  }
  result.left_out = std::max<int64_t>(0, pulses - std::ssize(result.clip.frames));
  return result;
}

void write_clip(const TakeClip& edited, const fs::path& source, const std::string& edits,
                const fs::path& out) {
  check_output(out);
  const MotionFile motion = motion_file(edited.clip, out);
  const fs::path place = normal_folder(fs::weakly_canonical(out));
  io::throw_if_failed(io::create_folders(place.parent_path()));
  PartialFolder folder(place, PartialFolder::Existing::kReplace);
  const take::TakePaths from{source}, to{folder.path()};
  take::TakeInfo info = take::load_take_info(from);
  info.name = name_of(out);
  info.rate_hz = edited.clip.rate_hz;
  info.pulses = std::ssize(edited.clip.frames);
  info.state = take::TakeState::kComplete;
  io::throw_if_failed(io::replace_file(to.edit(), edits));
  io::throw_if_failed(io::replace_file(to.calib(), read_file(from.calib())));
  io::throw_if_failed(io::replace_file(to.motion(), motion.bytes));
  replace_file(to.folder / "skeleton.json", skeleton_file(edited, motion));
  io::throw_if_failed(take::save_take_info(to, info));
  check_output(out);  // another program may have written there meanwhile
  folder.finish();
}

}  // namespace v3d::ctl
