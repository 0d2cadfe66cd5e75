#include "v3dctl/edit/take_clip.h"

#include <algorithm>
#include <map>
#include <utility>

#include "base/core/error.h"
#include "base/io/file.h"
#include "codec/motion_codec.h"
#include "common/console.h"
#include "recon/pipeline/compact_frame.h"
#include "take/take.h"
#include "v3dctl/motion/tracked_surfaces.h"
#include "v3dctl/skeleton/take_skeleton.h"

namespace v3d::ctl {
namespace {

namespace fs = std::filesystem;

/// Adds the frames of a segment that no later segment shows.
class ClipMaker {
 public:
  ClipMaker(const fs::path& take, TakeSkeleton skeleton)
      : surfaces_(take::TakePaths{take}.motion()), skeleton_(std::move(skeleton)) {
    for (const recon::SkeletonPulse& pulse : skeleton_.structure.pulses) {
      skeletons_[skeleton_.pulses[pulse.index]] = &pulse;
    }
    for (const TrackedSurfaces::Place& place : surfaces_.places()) last_place_[place.pulse] = place;
  }

  recon::Clip make() {
    recon::Clip clip;
    clip.rate_hz = skeleton_.rate_hz > 0 ? skeleton_.rate_hz : 25;
    for (size_t b = 0; b < skeleton_.tracked.size(); ++b) {
      if (!skeleton_.skins[b].influences.empty()) add_surface(b, clip);
    }
    return clip;
  }

 private:
  void add_surface(size_t body, recon::Clip& clip) {
    const recon::TrackedBody& tracked = skeleton_.tracked[body];
    clip.surfaces.push_back({tracked.surface.triangles, std::move(skeleton_.skins[body])});
    for (size_t p = 0; p < tracked.pulses.size(); ++p) {
      const int64_t pulse = tracked.pulses[p];
      const bool is_shown_later =
          body + 1 < skeleton_.tracked.size() &&
          std::ranges::binary_search(skeleton_.tracked[body + 1].pulses, pulse);
      if (is_shown_later) continue;
      recon::ClipFrame frame{.surface = clip.surfaces.size() - 1,
                             .places = tracked.positions[p],
                             .colours = surfaces_.read(last_place_.at(pulse)).colours,
                             .skeleton = *skeletons_.at(pulse)};
      if (frame.colours.size() != frame.places.size()) frame.colours = tracked.surface.colours;
      clip.frames.push_back(std::move(frame));
    }
  }

  TrackedSurfaces surfaces_;
  TakeSkeleton skeleton_;
  std::map<int64_t, const recon::SkeletonPulse*> skeletons_;
  std::map<int64_t, TrackedSurfaces::Place> last_place_;
};

/// motion.v3d: successive frames of one surface are a segment.
std::string motion_file(const recon::Clip& clip, const fs::path& out) {
  const std::vector<uint8_t> header = codec::MotionWriter::header();
  std::string bytes(header.begin(), header.end());
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
      auto& places = segment.positions.emplace_back();
      for (const Eigen::Vector3f& place : frame.places) {
        places.push_back({place.x(), place.y(), place.z()});
      }
      if (!frame.colours.empty()) segment.colours.push_back(recon::vertex_colours(frame.colours));
    }
    const auto encoded = writer.add(segment);
    if (!encoded) {
      throw InputError(out.string() + ": the surface before frame " + std::to_string(f) +
                       " exceeds the limits of motion.v3d (docs/motion-format.md)");
    }
    bytes.append(encoded->bytes.begin(), encoded->bytes.end());
  }
  return bytes;
}

/// skeleton.json of an edited clip.
std::string skeleton_file(const TakeClip& edited) {
  TakeSkeleton skeleton;
  skeleton.rate_hz = edited.clip.rate_hz;
  skeleton.structure.lengths = recon::BodyLengths(edited.stature_m, 0);
  skeleton.structure.has_prop = edited.has_prop;
  for (size_t f = 0; f < edited.clip.frames.size(); ++f) {
    skeleton.pulses.push_back(static_cast<int64_t>(f));
    skeleton.structure.pulses.push_back(edited.clip.frames[f].skeleton);
    skeleton.structure.pulses.back().index = f;
  }
  return skeleton_json(skeleton);
}

}  // namespace

void check_output(const fs::path& out) {
  std::error_code error;
  const bool is_new =
      !fs::exists(out, error) || (fs::is_directory(out, error) && fs::is_empty(out, error));
  if (!error && (is_new || fs::exists(out / "edit.json", error))) return;
  throw InputError(out.string() + ": holds something else than an edited take; choose another OUT");
}

TakeClip read_clip(const fs::path& take, const std::function<void(int64_t)>& on_begin,
                   const std::function<void()>& on_pulse) {
  if (!file_exists(take::TakePaths{take}.motion())) {
    take::load_take_info({take});  // throws if the folder is not a take
    throw InputError(take.string() + ": has no tracked surface: run v3dctl track first");
  }
  TakeSkeleton skeleton = learn_skeleton(take, {}, 1, on_begin, on_pulse);
  TakeClip result;
  result.has_prop = skeleton.structure.has_prop;
  result.stature_m = skeleton.structure.lengths.stature_m();
  const int64_t pulses = std::ssize(skeleton.pulses);
  result.clip = ClipMaker(take, std::move(skeleton)).make();
  if (result.clip.frames.empty()) {
    throw InputError(take.string() + ": its tracked surface has no segment of three pulses");
  }
  result.left_out = std::max<int64_t>(0, pulses - std::ssize(result.clip.frames));
  return result;
}

void write_clip(const TakeClip& edited, const fs::path& source, const std::string& edits,
                const fs::path& out) {
  check_output(out);
  const std::string motion = motion_file(edited.clip, out);
  const take::TakePaths from{source}, to{out};
  take::TakeInfo info = take::load_take_info(from);
  info.name = out.filename().string();
  info.rate_hz = edited.clip.rate_hz;
  info.pulses = std::ssize(edited.clip.frames);
  info.state = take::TakeState::kComplete;
  io::throw_if_failed(io::create_folders(out));
  // edit.json comes first: it shows that the folder holds no recording.
  replace_file(out / "edit.json", edits);
  io::throw_if_failed(io::replace_file(to.calib(), read_file(from.calib())));
  io::throw_if_failed(io::replace_file(to.motion(), motion));
  replace_file(out / "skeleton.json", skeleton_file(edited));
  io::throw_if_failed(take::save_take_info(to, info));
}

}  // namespace v3d::ctl
