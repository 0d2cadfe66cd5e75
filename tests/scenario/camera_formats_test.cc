// Cameras that send more than 8 bits, with the real daemons.
#include <gmock/gmock.h>

#include <array>
#include <map>

#include "studio4.h"
#include "take/ledger/ledger.h"
#include "take/ledger/verify.h"
#include "take/logs/frame_log.h"
#include "take/logs/mesh_file.h"

namespace v3d::test {
namespace {

namespace fs = std::filesystem;
using testing::IsEmpty;

constexpr int kPulses = 20;
constexpr std::array kCameras = {"cam01", "cam02", "cam03", "cam04"};

/// Content of all files below `folder`, by relative path.
std::map<std::string, std::string> files_in(const fs::path& folder) {
  std::map<std::string, std::string> files;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    if (entry.is_regular_file()) {
      files[fs::relative(entry.path(), folder)] = read_file(entry.path());
    }
  }
  return files;
}

/// The simulated cameras put the index of a pixel into the low bits of its sample.
class DeepStudio : public Studio4, public testing::WithParamInterface<const char*> {
 protected:
  DeepStudio() : Studio4({.rate = "5", .simulator = {"--format", GetParam()}}) {}

  /// A copy of the take without the low bits of its frames, as a camera of 8 bits records it.
  take::TakePaths take_of_8_bits() const {
    const take::TakePaths copy{folder_ / "of-8-bits"};
    fs::copy(take().folder, copy.folder, fs::copy_options::recursive);
    for (const char* camera : kCameras) {
      fs::remove(copy.frames(camera));
      take::FrameLogReader frames(take().frames(camera));
      take::EventLogWriter log(copy.frames(camera));
      for (int64_t pulse = 0; pulse < kPulses; ++pulse) {
        wire::FrameMessage message;
        message.seq = pulse;
        message.take = take_name_;
        message.frame = frames.read(pulse).value();
        EXPECT_EQ(message.frame.image.format, PixelFormat::kBayerRG8);
        EXPECT_TRUE(log.write(message));
      }
    }
    return copy;
  }
  /// Reconstructs the take and exports a training set and a textured mesh of its pulse 5 to `out`.
  void reconstruct_and_export(const take::TakePaths& of, const fs::path& out) {
    run_v3dctl({"reconstruct", of.folder, "--voxel", "40mm"}, 0);
    run_v3dctl({"export", of.folder, out / "colmap", "--format", "colmap", "--frames", "5:6"}, 0);
    run_v3dctl({"export", of.folder, out / "mesh.glb", "--format", "glb", "--atlas", "256",
                "--frames", "5:6"},
               0);
  }
};

TEST_P(DeepStudio, keeps_all_bits_in_the_take_and_has_meshes_of_the_pulses_it_sends) {
  const PixelFormat image = camera_format_from_name(GetParam()).value().image;
  const int low_bits = (1 << (bits_per_sample(image) - 8)) - 1;
  arm_and_start(kPulses);
  ASSERT_TRUE(becomes_idle()) << log();
  const take::Verification verified = verify_take(take());
  EXPECT_THAT(verified.disagreements, IsEmpty());
  // A busy capture node does not send every pulse, and a busy reconstruction drops some.
  const int64_t live = take::load_ledger(take().ledger()).cameras.at(0).published;
  const auto meshes = std::ssize(take::MeshFileReader(take().mesh()).pulses());
  EXPECT_EQ(meshes + static_cast<int64_t>(value("recon01", "dropped")), live) << log();
  EXPECT_GT(meshes, 0) << log();
  for (const char* camera : kCameras) {
    take::FrameLogReader frames(take().frames(camera));
    for (int64_t pulse = 0; pulse < kPulses; ++pulse) {
      const auto frame = frames.read_deep(pulse);
      ASSERT_TRUE(frame) << camera << " " << pulse;
      ASSERT_EQ(frame->image.format, image);
      const std::vector<uint8_t>& bytes = frame->image.bytes;
      for (size_t pixel = 0; 2 * pixel < bytes.size(); ++pixel) {
        ASSERT_EQ(bytes[2 * pixel] & low_bits, pixel & static_cast<size_t>(low_bits))
            << camera << " " << pulse << " " << pixel;
      }
    }
  }
}

/// All readers of takes get the upper 8 bits of a sample, so the tolerance is none: files are equal
/// in every byte.
TEST_P(DeepStudio, has_the_meshes_and_exported_colours_of_the_same_take_at_8_bits) {
  arm_and_start(kPulses);
  ASSERT_TRUE(becomes_idle()) << log();
  fs::create_directories(folder_ / "deep");
  fs::create_directories(folder_ / "shallow");
  const take::TakePaths shallow = take_of_8_bits();
  reconstruct_and_export(take(), folder_ / "deep");
  reconstruct_and_export(shallow, folder_ / "shallow");
  EXPECT_EQ(read_file(take().mesh()), read_file(shallow.mesh()));
  const auto deep_files = files_in(folder_ / "deep");
  EXPECT_GT(deep_files.size(), 5U) << "images, masks, cameras, points and a textured mesh";
  EXPECT_EQ(deep_files, files_in(folder_ / "shallow"));
}

INSTANTIATE_TEST_SUITE_P(Formats, DeepStudio,
                         testing::Values("BayerRG10", "BayerRG10p", "BayerRG10Packed", "BayerRG12",
                                         "BayerRG12p", "BayerRG12Packed"),
                         [](const auto& format) { return std::string(format.param); });

}  // namespace
}  // namespace v3d::test
