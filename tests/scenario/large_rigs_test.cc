// Soak tests of rigs with more or larger images than fifteen cameras of 1024x768: accuracy against
// the simulated truth, and memory within the bounds of docs/scaling.md for short takes.
#include <gtest/gtest.h>

#include <cstdlib>
#include <nlohmann/json.hpp>

#include "base/geometry/camera_model.h"
#include "base/io/file.h"
#include "support/temporary_folder.h"

namespace v3d {
namespace {

using nlohmann::json;

constexpr char kSpace[] = " --bounds=-1.5,-1.5,0,1.5,1.5,2 --voxel ";

/// Memory bound of a reconstruction of three pulses, or of one pulse in high quality
/// (docs/scaling.md, "Memory"): a constant part and bytes for every pixel of every camera. Takes of
/// twelve and more pulses need 15 and 34 bytes; a test would take too long to simulate them.
constexpr double kMegabytes = 64;
constexpr double kLiveBytesPerPixel = 12;
constexpr double kHighBytesPerPixel = 26;

/// The documented memory bound, MB.
double max_mb(int cameras, ImageSize size, double bytes_per_pixel) {
  return kMegabytes + 1e-6 * bytes_per_pixel * cameras * static_cast<double>(size.pixels());
}

class LargeRigs : public testing::Test {
 protected:
  /// Simulates a take of three pulses, so that every stage of the reconstruction holds one.
  void make_take(const std::string& name, int cameras, ImageSize size) {
    run("v3d-sim", "take " + at(name) + " --frames 3 --begin 1.5 --cameras " +
                       std::to_string(cameras) + " --size " + std::to_string(size.width) + "x" +
                       std::to_string(size.height) + " --truth " + at(name + "-truth"));
  }
  json reconstruct(const std::string& name, const std::string& voxel,
                   const std::string& more = "") {
    return printed("v3dctl", "reconstruct " + at(name) + kSpace + voxel + more + " --json");
  }
  json evaluate(const std::string& name) {
    return printed("v3dctl",
                   "evaluate " + at(name) + " --truth " + at(name + "-truth") + " --json");
  }

  std::string at(const std::string& name) const { return (folder_ / name).string(); }
  json printed(const std::string& program, const std::string& arguments) {
    run(program, arguments + " > " + at("out.json"));
    return json::parse(read_file(folder_ / "out.json"));
  }
  void run(const std::string& program, const std::string& arguments) {
    const std::string command = V3D_BIN "/" + program + " " + arguments + " 2> " + at("err.txt");
    ASSERT_EQ(std::system(command.c_str()), 0) << command << "\n" << read_file(folder_ / "err.txt");
  }

  const test::TemporaryFolder folder_;
};

constexpr ImageSize kXga{1024, 768}, k4k{4096, 3072};

double accuracy(const json& evaluated) { return evaluated["distance_mm"]["accuracy_p50"]; }
double completeness(const json& evaluated) { return evaluated["distance_mm"]["completeness_p50"]; }
double within_5mm(const json& evaluated) { return evaluated["f_score"]["5mm"]; }

double min_iou(const json& made) { return made["silhouette_iou"]["min"]; }
double peak_mb(const json& made) { return made["peak_rss_mb"]; }

TEST_F(LargeRigs, with_60_cameras_are_more_accurate_than_with_15_within_the_documented_memory) {
  make_take("usual", 15, kXga);
  make_take("large", 60, kXga);
  reconstruct("usual", "14mm");
  const json made = reconstruct("large", "14mm");
  const json usual = evaluate("usual"), large = evaluate("large");
  EXPECT_LT(accuracy(large), accuracy(usual));
  EXPECT_LT(completeness(large), completeness(usual));
  EXPECT_GT(within_5mm(large), within_5mm(usual));
  EXPECT_GT(min_iou(made), 0.96);
  EXPECT_LT(peak_mb(made), max_mb(60, kXga, kLiveBytesPerPixel));
}

TEST_F(LargeRigs,
       with_8_cameras_of_4096x3072_are_as_accurate_as_with_1024x768_within_the_documented_memory) {
  make_take("usual", 8, kXga);
  make_take("fine", 8, k4k);
  reconstruct("usual", "14mm");
  json made = reconstruct("fine", "14mm");
  json usual = evaluate("usual"), fine = evaluate("fine");
  // A voxel is many pixels wide, so more pixels do not improve the hull.
  EXPECT_NEAR(accuracy(fine), accuracy(usual), 0.1 * accuracy(usual));
  EXPECT_NEAR(completeness(fine), completeness(usual), 0.1 * completeness(usual));
  EXPECT_GT(min_iou(made), 0.96);
  EXPECT_LT(peak_mb(made), max_mb(8, k4k, kLiveBytesPerPixel));

  const std::string high = " --quality high --frames 0:1";
  reconstruct("usual", "10mm", high);
  made = reconstruct("fine", "10mm", high);
  usual = evaluate("usual"), fine = evaluate("fine");
  EXPECT_GT(within_5mm(fine), 0.98 * within_5mm(usual));
  EXPECT_LT(peak_mb(made), max_mb(8, k4k, kHighBytesPerPixel));
}

}  // namespace
}  // namespace v3d
