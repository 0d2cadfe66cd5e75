#include "v3dctl/skeleton/take_skeleton.h"

#include <fmt/core.h>

#include <algorithm>
#include <chrono>
#include <iterator>
#include <optional>
#include <set>
#include <utility>

#include "base/core/error.h"
#include "base/core/statistics.h"
#include "base/core/text.h"
#include "base/io/process.h"
#include "common/console.h"
#include "daemon/recorded/mesh_frames.h"
#include "recon/skeleton/reeb_graph.h"
#include "v3dctl/motion/tracked_surfaces.h"
#include "v3dctl/options.h"

namespace v3d::ctl {
namespace {

namespace fs = std::filesystem;

constexpr double kMinStatureM = 1.2, kMaxStatureM = 2.1;  ///< of a person who stands upright

/// The mesh of a frame; throws InputError for positions that are not finite.
Mesh checked_mesh(const fs::path& take, recon::CompactFrame frame) {
  for (const Eigen::Vector3f& vertex : frame.mesh.vertices) {
    if (vertex.allFinite()) continue;
    throw InputError(take.string() + ": the mesh of pulse " + std::to_string(frame.pulse) +
                     " has positions that are not finite; reconstruct it again");
  }
  return std::move(frame.mesh);
}

/// Uses the tracked surfaces of a take. `identities`: of its performers; none: not stated.
void add_tracked(const fs::path& take, const std::set<uint8_t>& identities, TakeSkeleton& result) {
  const fs::path file = take::TakePaths{take}.motion();
  if (!fs::exists(file)) return;
  if (identities.size() > 1) {
    result.unused_motion = "motion.v3d is not used: the take has several performers";
    result.problems.push_back(result.unused_motion);
    return;
  }
  result.tracked = read_tracked_bodies(file, result.pulses);
  result.skins = recon::learn_from_tracked(result.tracked, result.pulses, result.structure);
}

/// Keeps one performer of a frame whose vertices have labels. A frame without labels shows only
/// performer 1, the largest component. Throws InputError for another one.
void keep_performer(const fs::path& take, recon::CompactFrame& frame, int performer) {
  if (frame.performers.empty()) {
    if (performer == 1 || frame.mesh.triangles.empty()) return;
    throw InputError("--performer " + std::to_string(performer) + ": pulse " +
                     std::to_string(frame.pulse) + " of " + take.string() +
                     " does not state performers; expected a take after v3dctl performers");
  }
  frame.mesh.triangles = recon::triangles_of_performer(frame.mesh, frame.performers, performer);
}

/// What read_tracked_bodies() keeps at these pulses, bytes.
uint64_t surface_bytes(const fs::path& motion, std::span<const int64_t> pulses) {
  const TrackedSurfaces surfaces(motion);
  uint64_t bytes = 0;
  for (const codec::MotionSegmentInfo& segment : surfaces.segments()) {
    const auto kept = static_cast<uint64_t>(std::ranges::count_if(
        segment.pulses, [&](int64_t pulse) { return std::ranges::binary_search(pulses, pulse); }));
    const size_t of_vertex = sizeof(Eigen::Vector3f) + (segment.coloured ? sizeof(Rgb8) : 0);
    bytes += kept * segment.vertices * of_vertex;
  }
  return bytes;
}

/// Before the graphs, which can take an hour. Throws InputError where the tracked surfaces would
/// need more than `max_bytes`. Those of several performers are not read (add_tracked()).
void require_surface_memory(const fs::path& take, recorded::MeshFrames& meshes,
                            std::span<const int64_t> pulses, uint64_t max_bytes) {
  const fs::path motion = take::TakePaths{take}.motion();
  if (!fs::exists(motion)) return;
  const std::vector<uint8_t> labels = meshes.read(pulses.front()).performers;
  std::set<uint8_t> identities(labels.begin(), labels.end());
  identities.erase(0);
  if (identities.size() > 1) return;
  const uint64_t bytes = surface_bytes(motion, pulses);
  if (bytes <= max_bytes) return;
  throw InputError(motion.string() + ": its surfaces at these pulses need " +
                   format_bytes(static_cast<double>(bytes)) + ", more than the memory permits (" +
                   format_bytes(static_cast<double>(max_bytes)) +
                   "); expected fewer --frames of v3dctl skeleton, or v3dctl track with fewer "
                   "--frames or --triangles");
}

/// Throws InputError where labels of `identities` do not include the performer.
void require_performer(const fs::path& take, const std::set<uint8_t>& identities, int performer) {
  if (identities.empty() || identities.contains(static_cast<uint8_t>(performer))) return;
  throw InputError("--performer " + std::to_string(performer) +
                   ": no pulse shows this performer; v3dctl performers " + take.string() +
                   " lists them");
}

}  // namespace

std::vector<std::string> doubts_about(const recon::KinematicStructure& structure) {
  std::vector<std::string> doubts;
  if (structure.good == 0) {
    doubts.emplace_back(
        "no pulse shows head, feet and hands, so joints can be anywhere: expected a person who "
        "stands upright with free arms in at least one pulse");
  }
  if (2 * structure.upright < structure.pulses.size()) {
    doubts.emplace_back("the body does not stand upright: it is wider than high at most pulses");
  }
  const double stature_m = structure.lengths.stature_m();
  if (stature_m < kMinStatureM || stature_m > kMaxStatureM) {
    doubts.push_back(
        fmt::format("the body does not stand upright, or is no adult: the stature would be {:.2f} "
                    "m, expected {:.1f} to {:.1f} m",
                    stature_m, kMinStatureM, kMaxStatureM));
  }
  return doubts;
}

uint64_t default_max_surface_bytes() { return static_cast<uint64_t>(available_memory()) / 2; }

TakeSkeleton learn_skeleton(const fs::path& take, take::FrameRange frames, int performer,
                            const std::function<void(int64_t)>& on_begin,
                            const std::function<void()>& on_pulse, uint64_t max_surface_bytes) {
  TakeSkeleton result;
  recorded::MeshFrames meshes(take);
  result.pulses = meshes.frames(frames);
  result.is_unfinished = meshes.is_unfinished();
  result.rate_hz = take::load_take_info({take}).rate_hz;
  require_surface_memory(take, meshes, result.pulses, max_surface_bytes);
  on_begin(std::ssize(result.pulses));
  std::vector<recon::BodyEvidence> evidence;
  std::vector<double> times_ms;
  int64_t several = 0, without = 0;
  std::set<uint8_t> identities;
  std::string reason;
  for (const int64_t pulse : result.pulses) {
    recon::CompactFrame frame = meshes.read(pulse);
    identities.insert(frame.performers.begin(), frame.performers.end());
    keep_performer(take, frame, performer);
    const Mesh mesh = checked_mesh(take, std::move(frame));
    const auto begin = std::chrono::steady_clock::now();
    const recon::ReebGraph graph = recon::reeb_graph(mesh);
    const std::chrono::duration<double, std::milli> elapsed =
        std::chrono::steady_clock::now() - begin;
    times_ms.push_back(elapsed.count());
    evidence.push_back(recon::body_evidence(mesh, graph));
    several += evidence.back().has_other_bodies ? 1 : 0;
    if (!evidence.back().problem.empty()) {
      ++without;
      reason = evidence.back().problem;
    }
    on_pulse();
    stop_if_interrupted();
  }
  result.graph_ms = median(times_ms);
  if (several > 0) {
    result.problems.push_back(
        count_of(several, "pulse") +
        " with several bodies: the largest has the skeleton; v3dctl performers "
        "labels them");
  }
  if (without > 0) {
    result.problems.push_back(count_of(without, "pulse") + " without a body: " + reason);
  }
  result.structure = recon::kinematic_structure(evidence, result.pulses);
  identities.erase(0);  // the label of vertices whose performer is unknown
  if (result.structure.pulses.empty()) {
    require_performer(take, identities, performer);
    throw InputError(take.string() + ": no pulse shows a body: " + reason);
  }
  std::ranges::copy(doubts_about(result.structure), std::back_inserter(result.problems));
  add_tracked(take, identities, result);
  return result;
}

SimilarPoseList similar_poses(const fs::path& take, int64_t pulse, const fs::path& other,
                              take::FrameRange frames, size_t count) {
  recorded::MeshFrames queries(take);
  const recon::ReebGraph query = recon::reeb_graph(checked_mesh(take, queries.read(pulse)));
  if (query.empty()) {
    throw InputError(take.string() + ": the mesh of pulse " + std::to_string(pulse) +
                     " is empty; choose another pulse");
  }
  recorded::MeshFrames meshes(other);
  const bool same = fs::equivalent(take, other);
  const auto apart = static_cast<int64_t>(0.5 * take::load_take_info({other}).rate_hz) + 1;
  std::vector<int64_t> pulses;
  std::vector<recon::ReebGraph> graphs;
  for (const int64_t candidate : meshes.frames(frames)) {
    if (same && std::abs(candidate - pulse) < apart) continue;
    pulses.push_back(candidate);
    graphs.push_back(recon::reeb_graph(checked_mesh(other, meshes.read(candidate))));
  }
  SimilarPoseList result;
  if (queries.is_unfinished()) result.unfinished.push_back(queries.path());
  if (!same && meshes.is_unfinished()) result.unfinished.push_back(meshes.path());
  for (const recon::SimilarPulse& found :
       recon::most_similar(query, graphs, pulses, count, apart)) {
    result.poses.push_back({found.pulse, found.similarity});
  }
  return result;
}

namespace {

constexpr size_t kMinPulses = 3;

bool is_limb(recon::Joint part) {
  using namespace recon;
  return part != kPelvis && part != kNeck && part != kHead && part != kPropBase;
}

}  // namespace

std::vector<recon::TrackedBody> read_tracked_bodies(const std::filesystem::path& file,
                                                    std::span<const int64_t> pulses) {
  TrackedSurfaces surfaces(file);
  std::vector<recon::TrackedBody> bodies(surfaces.segments().size());
  for (const TrackedSurfaces::Place& place : surfaces.places()) {
    if (!std::ranges::binary_search(pulses, place.pulse)) continue;
    recon::TrackedBody& body = bodies[place.segment];
    const codec::MotionSegmentInfo& segment = surfaces.segments()[place.segment];
    Mesh surface = surfaces.read(place);
    body.pulses.push_back(place.pulse);
    body.positions.push_back(surface.vertices);
    body.colours.push_back(surface.colours);
    const bool is_rest = place.index == segment.key || body.positions.size() == 1;
    if (!is_rest) continue;
    body.rest = body.positions.size() - 1;
    body.surface = std::move(surface);
  }
  std::erase_if(bodies, [](const auto& body) { return body.pulses.size() < kMinPulses; });
  return bodies;
}

SkinError skin_error(std::span<const recon::TrackedBody> bodies,
                     std::span<const recon::Skin> skins) {
  SkinError error;
  std::vector<double> millimetres;
  for (size_t b = 0; b < bodies.size(); ++b) {
    if (skins[b].influences.empty()) continue;
    for (size_t p = 0; p < bodies[b].pulses.size(); ++p) {
      const recon::PartMotion motion = recon::part_motion(skins[b].rest, skins[b].poses[p]);
      const std::vector<Eigen::Vector3f> moved =
          recon::skinned(skins[b], motion, bodies[b].surface.vertices);
      for (size_t v = 0; v < moved.size(); ++v) {
        if (!is_limb(skins[b].influences[v].part[0])) continue;
        millimetres.push_back(1000 * double{(moved[v] - bodies[b].positions[p][v]).norm()});
      }
      ++error.pulses;
    }
  }
  if (millimetres.empty()) return error;
  error.p50_mm = percentile(millimetres, 0.5);
  error.p90_mm = percentile(millimetres, 0.9);
  return error;
}

}  // namespace v3d::ctl
