// Rate and distortion of tracked meshes against Draco, on a folder of meshes without images.
//
// The folder is tracked once. Its surface is coded with several steps (codec/motion_codec.h), and
// the given meshes with Draco, each alone. The error of a coded sequence is the root mean square of
// the distances of random points, from each given mesh to the decoded one and back.
#include <fmt/core.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <optional>
#include <vector>

#include "base/core/error.h"
#include "base/core/statistics.h"
#include "base/core/text.h"
#include "cli/command.h"
#include "codec/motion_codec.h"
#include "rate_distortion_points/coder.h"
#include "recon/metrics/nearest_triangle.h"
#include "recon/motion/motion_tracker.h"
#include "recon/render/renderer.h"
#include "v3dctl/motion/pulse_source.h"

namespace v3d::bench {
namespace {

using Json = nlohmann::ordered_json;

constexpr int kSamples = 20'000;
constexpr double kMillimetres = 1000;
constexpr int kDracoSpeed = 0;  // the smallest files
const std::vector<double> kStepsM{0.00025, 0.0005, 0.001, 0.002, 0.004, 0.008, 0.016, 0.032};

/// Root mean squares of distances, and medians.
struct SurfaceError {
  double rms_mm = 0;  ///< of both directions
  double to_decoded_rms_mm = 0, to_given_rms_mm = 0;
  double p50_mm = 0;  ///< of both directions
};

struct RatePoint {
  double step_m = 0, bytes = 0;  ///< bytes of one pulse, mean
  SurfaceError error{};
};

std::vector<double> distances_mm(const Mesh& from, const Mesh& to) {
  const recon::NearestTriangle tree(to);
  std::vector<double> distances;
  for (const recon::SurfaceSample& sample : recon::sample_surface(from, kSamples, 1)) {
    const auto found = tree.find(sample.position);
    if (found) distances.push_back(kMillimetres * found->distance);
  }
  return distances;
}

double rms_of(const std::vector<double>& values) {
  double sum = 0;
  for (const double value : values) sum += value * value;
  return std::sqrt(sum / static_cast<double>(values.size()));
}

SurfaceError error_of(const std::vector<Mesh>& given, const std::vector<Mesh>& decoded) {
  std::vector<std::vector<double>> to_decoded(given.size()), to_given(given.size());
  tbb::parallel_for(size_t{0}, given.size(), [&](size_t i) {
    to_decoded[i] = distances_mm(given[i], decoded[i]);
    to_given[i] = distances_mm(decoded[i], given[i]);
  });
  std::vector<double> there, back;
  for (const auto& part : to_decoded) there.insert(there.end(), part.begin(), part.end());
  for (const auto& part : to_given) back.insert(back.end(), part.begin(), part.end());
  SurfaceError error{.to_decoded_rms_mm = rms_of(there), .to_given_rms_mm = rms_of(back)};
  there.insert(there.end(), back.begin(), back.end());
  error.rms_mm = rms_of(there);
  error.p50_mm = percentile(there, 0.5);
  return error;
}

RatePoint draco_point(const std::vector<Mesh>& given, double step_m) {
  RatePoint point{.step_m = step_m};
  std::vector<Mesh> decoded = given;
  for (Mesh& mesh : decoded) {
    const Coded coded =
        code_with_draco(mesh, {recon::bounds_of(mesh).min, step_m, /*colour_step=*/0}, kDracoSpeed);
    point.bytes += static_cast<double>(coded.bytes) / static_cast<double>(given.size());
    for (size_t v = 0; v < mesh.vertices.size(); ++v) {
      const auto& [x, y, z] = coded.positions[v];
      mesh.vertices[v] = {x, y, z};
    }
  }
  point.error = error_of(given, decoded);
  return point;
}

RatePoint motion_point(const std::vector<Mesh>& given, const recon::TrackedMotion& motion,
                       double step_m) {
  RatePoint point{.step_m = step_m};
  std::vector<Mesh> decoded;
  std::vector<uint8_t> file = codec::MotionWriter::header();
  codec::MotionWriter writer({.step_m = step_m});
  for (const recon::TrackedSegment& segment : motion.segments) {
    const auto encoded = writer.add(recon::motion_segment(segment));
    if (!encoded) throw InputError("the tracked surface cannot be coded");
    file.insert(file.end(), encoded->bytes.begin(), encoded->bytes.end());
  }
  auto reader = codec::MotionReader::open(file);
  for (size_t s = 0; s < reader->segments().size(); ++s) {
    for (size_t i = 0; i < reader->segments()[s].pulses.size(); ++i) {
      Mesh mesh;
      mesh.triangles = reader->surface(s)->triangles;
      for (const auto& [x, y, z] : reader->decode(s, i)->positions) {
        mesh.vertices.emplace_back(x, y, z);
      }
      decoded.push_back(std::move(mesh));
    }
  }
  point.bytes = static_cast<double>(file.size()) / static_cast<double>(given.size());
  point.error = error_of(given, decoded);
  return point;
}

/// Bytes of a curve at an error, linear between its points in the logarithms; empty outside the
/// curve.
std::optional<double> bytes_at(const std::vector<RatePoint>& curve, double SurfaceError::*measure,
                               double error) {
  for (size_t i = 0; i + 1 < curve.size(); ++i) {
    const double low = curve[i].error.*measure, high = curve[i + 1].error.*measure;
    if (error < low || error > high) continue;
    const double share = std::log(error / low) / std::log(high / low);
    return curve[i].bytes * std::pow(curve[i + 1].bytes / curve[i].bytes, share);
  }
  return std::nullopt;
}

/// Bytes of the tracked surface as part of those of Draco, at the same error.
Json at_equal(const std::vector<RatePoint>& tracked, const std::vector<RatePoint>& draco,
              double SurfaceError::*measure) {
  Json list = Json::array();
  for (const RatePoint& point : tracked) {
    const auto bytes = bytes_at(draco, measure, point.error.*measure);
    if (!bytes) continue;
    list.push_back({{"error_mm", point.error.*measure},
                    {"motion_bytes", point.bytes},
                    {"draco_bytes", *bytes},
                    {"part", point.bytes / *bytes}});
  }
  return list;
}

Json to_json(const std::vector<RatePoint>& curve) {
  Json list = Json::array();
  for (const RatePoint& point : curve) {
    list.push_back({{"step_mm", kMillimetres * point.step_m},
                    {"bytes", point.bytes},
                    {"rms_mm", point.error.rms_mm},
                    {"to_decoded_rms_mm", point.error.to_decoded_rms_mm},
                    {"to_given_rms_mm", point.error.to_given_rms_mm},
                    {"p50_mm", point.error.p50_mm}});
  }
  return list;
}

void run(const std::filesystem::path& folder, double height_m, size_t triangles) {
  const auto input = ctl::open_mesh_folder(folder, height_m, {});
  std::vector<Mesh> given;
  for (size_t i = 0; i < input->pulses().size(); ++i) given.push_back(input->read(i)->surface);
  recon::TrackingOptions options;
  options.triangles = triangles;
  const recon::PulseSource source = [&](size_t i) { return input->read(i); };
  const recon::TrackedMotion motion =
      recon::track_motion({source, source}, given.size(), options, [](size_t) {});

  std::vector<RatePoint> draco, tracked;
  for (const double step_m : kStepsM) {
    draco.push_back(draco_point(given, step_m));
    tracked.push_back(motion_point(given, motion, step_m));
  }
  const Json result = {{"pulses", given.size()},
                       {"segments", motion.segments.size()},
                       {"draco", to_json(draco)},
                       {"motion", to_json(tracked)},
                       {"at_equal_rms", at_equal(tracked, draco, &SurfaceError::rms_mm)},
                       {"at_equal_p50", at_equal(tracked, draco, &SurfaceError::p50_mm)}};
  fmt::print("{}\n", result.dump(2));
}

}  // namespace
}  // namespace v3d::bench

int main(int argc, char** argv) {
  std::filesystem::path folder;
  std::string height = "1.8m";
  int64_t triangles = 30'000;
  v3d::cli::Program app{
      "Tracks a folder of meshes, and compares the bytes of the tracked surface with those of "
      "Draco at equal error."};
  app.add_option("MESHES", folder, "Folder with one mesh (.obj, .ply) for each pulse").required();
  app.add_option("--height", height, "Height of the first mesh").type_name("LEN").show_default();
  app.add_option("--triangles", triangles, "Triangles of a template")
      .show_default()
      .check(v3d::cli::integer_in(1000, 1'000'000));
  if (const auto status = app.parse_or_report(argc, argv)) return *status;
  try {
    v3d::bench::run(folder, v3d::parse_length(height), static_cast<size_t>(triangles));
  } catch (const v3d::InputError& error) {
    std::fprintf(stderr, "v3d-motion-compression: %s\n", error.what());
    return 2;
  }
}
