// v3d-room-colours: measures which part of a performer's surface has a wrong colour when loose
// silhouettes contain pixels of the room. Simulated studios, against the true colours.
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "base/core/error.h"
#include "base/image/image_files.h"
#include "base/image/mask_operations.h"
#include "base/io/file.h"
#include "calib/colour/colour_fit.h"
#include "capture/segmentation/segmenter.h"
#include "cli/command.h"
#include "recon/metrics/nearest_triangle.h"
#include "recon/pipeline/reconstructor.h"
#include "recon/render/renderer.h"
#include "sim/performer/performer.h"
#include "sim/rendering/camera_images.h"
#include "sim/rendering/scene.h"
#include "workload.h"

namespace v3d::bench {
namespace {

constexpr double kWrongDeltaE = 20;    ///< CIEDE2000 from which a colour is wrong
constexpr double kFirstInstant = 0.3;  ///< seconds of the action
constexpr double kInstantStep = 0.9;

struct Arguments {
  uint64_t seed = 1;
  int cameras = 7;
  int instants = 4;
  int dilate_px = 3;
  double voxel_mm = 10;
  std::string quality = "live";
  std::filesystem::path picture;
};

// True colours.

/// The performer at one instant: the surface, and its colours in the light of the studio.
class TruePerformer {
 public:
  TruePerformer(double seconds, uint64_t seed) : seed_(seed) {
    const std::vector<sim::Part> parts = sim::performer_parts(seconds, seed);
    outside_ = sim::outer_surface(parts, seed);
    for (const sim::Part& part : parts) append(drawn_, part);
    all_ = {drawn_.vertices, drawn_.triangles, {}};
    nearest_outside_.emplace(outside_);
    nearest_part_.emplace(all_);
  }
  TruePerformer(const TruePerformer&) = delete;  // the queries refer to the meshes
  TruePerformer& operator=(const TruePerformer&) = delete;

  /// L*a*b* of the point of the visible surface nearest to `position` (world, metres), averaged
  /// over about two pixels of a camera.
  Eigen::Vector3d lab_near(const Eigen::Vector3f& position) const {
    const recon::SurfacePoint on = nearest_outside_->find(position.cast<double>()).value();
    const Eigen::Vector3d foot =
        recon::interpolated(outside_, outside_.vertices, on.triangle, on.weights);
    const recon::SurfacePoint at = nearest_part_->find(foot).value();
    const auto value = [&](const std::vector<Eigen::Vector3f>& values) -> Eigen::Vector3f {
      return recon::interpolated(all_, values, at.triangle, at.weights).cast<float>();
    };
    const float light = sim::light_on(value(drawn_.normals).normalized());
    const Eigen::Vector3f colour =
        light * mean_paint(drawn_.materials[at.triangle], value(drawn_.paint));
    return calib::lab_of(colour.cwiseMin(1.0F).cast<double>());
  }

 private:
  static constexpr float kStepM = 0.004F;  ///< about a pixel of the simulated cameras

  /// Mean of the texture over a cube of 3 x 3 x 3 positions.
  Eigen::Vector3f mean_paint(sim::Material material, const Eigen::Vector3f& texture) const {
    Eigen::Vector3f sum(0, 0, 0);
    for (int i = 0; i < 27; ++i) {
      const Eigen::Vector3i step(i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1);
      sum += sim::paint(material, texture + kStepM * step.cast<float>(), seed_);
    }
    return sum / 27;
  }

  uint64_t seed_;
  Mesh outside_;
  sim::DrawList drawn_;  ///< all parts
  Mesh all_;             ///< its surface
  std::optional<recon::NearestTriangle> nearest_outside_, nearest_part_;
};

/// By vertex of `mesh`: whether its colour is wrong.
std::vector<uint8_t> wrong_vertices(const Mesh& mesh, const std::vector<Eigen::Vector3d>& truth) {
  std::vector<uint8_t> wrong(mesh.vertices.size());
  for (size_t v = 0; v < wrong.size(); ++v) {
    const Rgb8 c = mesh.colours[v];
    const Eigen::Vector3d lab = calib::lab_of(Eigen::Vector3d(c.r, c.g, c.b) / 255);
    wrong[v] = calib::delta_e_2000(lab, truth[v]) > kWrongDeltaE;
  }
  return wrong;
}

// Trials.

/// Images of one instant with silhouettes of each kind.
struct Shots {
  recon::FrameSet loose;   ///< dilated silhouettes
  recon::FrameSet plates;  ///< the same, with background differences
  recon::FrameSet exact;   ///< true silhouettes
};

/// Vertices with a wrong colour.
struct WrongColours {
  int64_t all = 0;
  int64_t by_the_room = 0;  ///< right with the true silhouettes
};

/// The kinds of colours that one mesh gets.
struct Counts {
  int64_t vertices = 0;
  WrongColours loose, plates;
  int64_t exact = 0;  ///< wrong with the true silhouettes
};

void add(const std::vector<uint8_t>& wrong, const std::vector<uint8_t>& exact,
         WrongColours& counts) {
  for (size_t v = 0; v < wrong.size(); ++v) {
    counts.all += wrong[v];
    counts.by_the_room += wrong[v] && !exact[v];
  }
}

class Trials {
 public:
  explicit Trials(const Arguments& arguments)
      : arguments_(arguments),
        voxel_m_(arguments.voxel_mm / 1000),
        rig_(sim::make_rig(arguments.cameras, kSize, arguments.seed)),
        film_(rig_, {.seed = arguments.seed}),
        reconstructor_(rig_, options_of(arguments)) {
    segmenters_ = learnt_segmenters(film_);
  }

  Counts run() {
    Counts counts;
    for (int i = 0; i < arguments_.instants; ++i) add(kFirstInstant + i * kInstantStep, i, counts);
    if (!arguments_.picture.empty()) write_picture();
    return counts;
  }

 private:
  static recon::ReconstructOptions options_of(const Arguments& arguments) {
    recon::ReconstructOptions chosen = options(arguments.voxel_mm / 1000, 0);
    chosen.quality = arguments.quality == "high"     ? Quality::kHigh
                     : arguments.quality == "medium" ? Quality::kMedium
                                                     : Quality::kLive;
    return chosen;
  }

  Shots shoot(double seconds, int number) {
    const std::vector<Image> images =
        film_.render_all(seconds, uint64_t{kPlates} + static_cast<uint64_t>(number));
    Shots shots;
    for (size_t c = 0; c < rig_.size(); ++c) {
      const auto add = [&](recon::FrameSet& set, const Mask& mask) {
        set.frames.push_back(observe(rig_[c].name, {}, images[c].view(), mask));
      };
      const Mask exact = sim::true_silhouette(rig_[c], seconds, arguments_.seed);
      const Mask loose = dilate(exact, arguments_.dilate_px);
      add(shots.exact, exact);
      add(shots.loose, loose);
      add(shots.plates, loose);
      shots.plates.frames.back().background_difference = segmenters_[c].segment(images[c].view());
    }
    return shots;
  }

  void colour(const recon::FrameSet& set, Mesh& mesh) const {
    const bool full = arguments_.quality == "high";
    colour_surface(rig_, usable_frames(rig_, set), voxel_m_,
                   full ? recon::ColourDetail::kFull : recon::ColourDetail::kLive, mesh);
  }

  /// The mesh is always that of the loose silhouettes.
  void add(double seconds, int number, Counts& counts) {
    const Shots shots = shoot(seconds, number);
    recon::FrameSetJob job(shots.loose);
    reconstructor_.make_surface(job);
    Mesh& mesh = job.result.mesh;
    const TruePerformer performer(seconds, arguments_.seed);
    std::vector<Eigen::Vector3d> truth(mesh.vertices.size());
    tbb::parallel_for(size_t{0}, truth.size(),
                      [&](size_t v) { truth[v] = performer.lab_near(mesh.vertices[v]); });
    const auto wrong_with = [&](const recon::FrameSet& set) {
      colour(set, mesh);
      return wrong_vertices(mesh, truth);
    };
    const auto exact = wrong_with(shots.exact);
    counts.vertices += std::ssize(exact);
    counts.exact += std::ranges::count(exact, 1);
    bench::add(wrong_with(shots.loose), exact, counts.loose);
    meshes_.push_back(mesh);
    bench::add(wrong_with(shots.plates), exact, counts.plates);
    meshes_.push_back(mesh);
  }

  /// The meshes with loose silhouettes, each without and with plates, from two opposite sides.
  void write_picture() const {
    std::vector<Image> views;
    for (const Mesh& mesh : meshes_) {
      for (const CameraModel& camera :
           recon::turntable_cameras(recon::bounds_of(mesh), 2, {320, 400})) {
        views.push_back(recon::draw_mesh(mesh, camera));
      }
    }
    const Image sheet = recon::contact_sheet(views, static_cast<int>(views.size()));
    const std::vector<uint8_t> jpeg = encode_jpeg(sheet.view(), 85);
    io::throw_if_failed(io::replace_file(
        arguments_.picture, {reinterpret_cast<const char*>(jpeg.data()), jpeg.size()}));
  }

  Arguments arguments_;
  double voxel_m_;
  Rig rig_;
  sim::BatchRenderer film_;
  recon::Reconstructor reconstructor_;
  std::vector<segmentation::Segmenter> segmenters_;
  std::vector<Mesh> meshes_;
};

void print(const Arguments& arguments, const Counts& counts) {
  const auto percent = [&](int64_t part) {
    return 100.0 * static_cast<double>(part) / static_cast<double>(counts.vertices);
  };
  std::printf(
      "seed %llu, %d cameras, silhouettes dilated by %d pixels, %s, %.3g mm: %lld vertices\n",
      static_cast<unsigned long long>(arguments.seed), arguments.cameras, arguments.dilate_px,
      arguments.quality.c_str(), arguments.voxel_mm, static_cast<long long>(counts.vertices));
  const auto print_wrong = [&](const char* with, const WrongColours& wrong) {
    std::printf("wrong colours %-22s %6.2f %%, right with true silhouettes %.2f %%\n", with,
                percent(wrong.all), percent(wrong.by_the_room));
  };
  print_wrong("without plates", counts.loose);
  print_wrong("with background plates", counts.plates);
  print_wrong("with true silhouettes", {.all = counts.exact});
}

}  // namespace
}  // namespace v3d::bench

int main(int argc, char** argv) {
  using v3d::cli::integer_in;
  v3d::bench::Arguments arguments;
  v3d::cli::Program app{
      "Reconstructs the simulated performer from dilated true silhouettes and prints the part of "
      "the vertices with a wrong colour: more than a CIEDE2000 of 20 from the nearest true place."};
  app.add_option("--seed", arguments.seed, "Studio and performer").show_default();
  app.add_option("--cameras", arguments.cameras).show_default().check(integer_in(4, 60));
  app.add_option("--instants", arguments.instants).show_default().check(integer_in(1, 100));
  app.add_option("--dilate", arguments.dilate_px, "Pixels").show_default().check(integer_in(0, 20));
  app.add_option("--voxel", arguments.voxel_mm, "Millimetres")
      .show_default()
      .check(v3d::cli::number_in(2, 50));
  app.add_option("--quality", arguments.quality)
      .show_default()
      .check(v3d::cli::one_of({"live", "medium", "high"}));
  app.add_option("--picture", arguments.picture, "Writes the meshes as a JPEG");
  if (const auto status = app.parse_or_report(argc, argv)) return *status;
  try {
    print(arguments, v3d::bench::Trials(arguments).run());
  } catch (const v3d::InputError& error) {
    std::fprintf(stderr, "v3d-room-colours: %s\n", error.what());
    return 2;
  }
  return 0;
}
