// usage: v3d-rate-distortion OUT: bytes of a frame against what is lost, for the compact frame,
// Draco and meshoptimizer, on the meshes of encode/10mm. Writes OUT/points.json and, for a general
// compressor to follow, what meshoptimizer made as OUT/meshopt-N. tools/bench/rate_distortion draws
// them.
#include <fmt/core.h>

#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "coder.h"
#include "workload.h"

namespace v3d::bench {
namespace {

using nlohmann::json;
namespace fs = std::filesystem;

constexpr double kHalfVoxelM = 0.005;
/// Room below the grid for vertices that were moved out of it; whole steps of every lattice here.
constexpr double kMarginM = 0.1;

/// Root of the mean squared distance between vertices, millimetres.
double position_error_mm(const std::vector<codec::VertexPosition>& found, const Mesh& mesh) {
  double sum = 0;
  for (size_t v = 0; v < found.size(); ++v) {
    for (int axis = 0; axis < 3; ++axis) {
      const double error = double{found[v][axis]} - mesh.vertices[v][axis];
      sum += error * error;
    }
  }
  return 1000 * std::sqrt(sum / static_cast<double>(found.size()));
}

/// Means over the pulses: bytes and errors.
class Mean {
 public:
  void add(double bytes, const std::vector<codec::VertexPosition>& positions,
           const std::vector<codec::VertexColour>& colours, const Pulse& pulse) {
    ++count_;
    bytes_ += bytes;
    error_mm_ += position_error_mm(positions, pulse.mesh);
    if (!colours.empty()) psnr_db_ += psnr_db(colours, pulse.colours);
    with_colours_ = !colours.empty();
  }
  json point(const std::string& coder, const std::string& setting) const {
    json point = {{"coder", coder},
                  {"setting", setting},
                  {"bytes", bytes_ / count_},
                  {"error_mm", error_mm_ / count_}};
    if (with_colours_) point["psnr_db"] = psnr_db_ / count_;
    return point;
  }

 private:
  double count_ = 0, bytes_ = 0, error_mm_ = 0, psnr_db_ = 0;
  bool with_colours_ = false;
};

/// A surface and the accuracies at which it is coded.
struct Sweep {
  std::string surface;
  const std::vector<Pulse>& pulses;
  std::vector<double> steps_mm;  ///< steps of positions, without colours; empty: on the lattice
  double fixed_step_mm;          ///< step of positions during the sweep of colours
  std::vector<double> colour_factors;  ///< factors on the colour steps of the compact frame
  std::vector<int> colour_steps;       ///< colour steps of the other coders
};

class Points {
 public:
  explicit Points(fs::path out) : out_(std::move(out)) {}

  void add(const Sweep& sweep) {
    surface_ = sweep.surface;
    for (const double step : sweep.steps_mm) {
      add_ours(sweep.pulses, step, 0);
      add_others(sweep.pulses, step, 0);
    }
    for (const double factor : sweep.colour_factors) {
      add_ours(sweep.pulses, sweep.fixed_step_mm, factor);
    }
    for (const int step : sweep.colour_steps) {
      add_others(sweep.pulses, sweep.fixed_step_mm, step);
    }
  }
  const json& all() const { return points_; }

 private:
  static std::string text_of(double mm) { return fmt::format("{:g} mm", mm); }

  void keep(json point, double step_mm) {
    point["surface"] = surface_;
    point["step_mm"] = step_mm;
    std::fprintf(stderr, "%s\n", point.dump().c_str());
    points_.push_back(std::move(point));
  }

  /// Adds points of the compact frame, first with key frames only, then in sequence. `factor` 0:
  /// without colours.
  void add_ours(const std::vector<Pulse>& pulses, double step_mm, double factor) {
    codec::EncoderOptions options;
    options.displacement_step_m = step_mm / 1000;
    for (uint8_t& step : options.colour_steps) {
      const double wanted = std::round(std::max(factor, 0.1) * step);
      step = static_cast<uint8_t>(std::clamp(wanted, 1.0, 64.0));
    }
    const std::string setting =
        text_of(step_mm) + (factor > 0 ? ", colours x" + std::to_string(factor).substr(0, 4) : "");
    for (const bool keys : {true, false}) {
      codec::FrameEncoder encoder(options);
      Mean mean;
      for (int n = 0; n < kPulses; ++n) {
        if (keys) encoder.restart();
        const codec::BrickVolume volume = pulses[n].volume.view();
        codec::FrameContent content = content_of(pulses[n], volume, n);
        if (factor == 0) content.colours = {};
        const auto bytes = static_cast<double>(encoder.encode(content).value().size());
        if (!keys && n == 0) continue;
        const codec::DecodedFrame decoded = encoder.decoded();
        mean.add(bytes, decoded.positions, decoded.colours, pulses[n]);
      }
      keep(mean.point(keys ? "ours, key frames" : "ours, in sequence", setting), step_mm);
    }
  }

  void add_others(const std::vector<Pulse>& pulses, double step_mm, int colour_step) {
    const std::string setting =
        text_of(step_mm) +
        (colour_step > 0 ? ", colours in steps of " + std::to_string(colour_step) : "");
    Mean smallest, usual, meshopt;
    json streams;
    for (const Pulse& pulse : pulses) {
      const Eigen::Vector3d low = pulse.volume.grid().origin.array() - kMarginM;
      const Accuracy accuracy{low, step_mm / 1000, colour_step};
      const auto add = [&](Mean& mean, const Coded& coded) {
        mean.add(static_cast<double>(coded.bytes), coded.positions, coded.colours, pulse);
      };
      add(smallest, code_with_draco(pulse.mesh, accuracy, 0));
      add(usual, code_with_draco(pulse.mesh, accuracy, 5));
      const MeshoptCoded coded = code_with_meshopt(pulse.mesh, accuracy);
      add(meshopt, coded);
      streams.push_back(save(coded.stream));
    }
    keep(smallest.point("Draco, smallest", setting), step_mm);
    keep(usual.point("Draco, its default", setting), step_mm);
    json point = meshopt.point("meshoptimizer", setting);
    point["streams"] = streams;
    keep(std::move(point), step_mm);
  }

  std::string save(const std::vector<uint8_t>& stream) {
    const std::string name = "meshopt-" + std::to_string(saved_++);
    std::ofstream(out_ / name, std::ios::binary)
        .write(reinterpret_cast<const char*>(stream.data()), std::ssize(stream));
    return name;
  }

  fs::path out_;
  std::string surface_;
  json points_ = json::array();
  int saved_ = 0;
};

int run(const fs::path& out) {
  fs::create_directories(out);
  Points points(out);
  points.add({.surface = "deformed",
              .pulses = high_pulses(),
              .steps_mm = {0.1, 0.2, 0.5, 1, 2.5, 5},
              .fixed_step_mm = 1,
              .colour_factors = {0.25, 0.5, 0.75, 1, 1.5, 2, 3},
              .colour_steps = {1, 2, 4, 8, 11, 16, 24, 32}});
  // The vertices of a hull lie on half voxels, so finer steps are useless.
  points.add({.surface = "hull",
              .pulses = live_pulses(),
              .steps_mm = {},
              .fixed_step_mm = 1000 * kHalfVoxelM,
              .colour_factors = {0.25, 0.5, 0.75, 1, 1.5, 2, 3},
              .colour_steps = {1, 2, 4, 8, 11, 16, 24, 32}});
  std::ofstream(out / "points.json") << points.all().dump(1) << "\n";
  return 0;
}

}  // namespace

}  // namespace v3d::bench

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "usage: v3d-rate-distortion OUT\n");
    return 2;
  }
  try {
    return v3d::bench::run(argv[1]);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "v3d-rate-distortion: %s\n", error.what());
    return 1;
  }
}
