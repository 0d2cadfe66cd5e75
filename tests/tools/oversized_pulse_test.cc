// Tests with a pulse whose surface exceeds the limits of a compact frame: all its pixels are
// foreground.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <utility>

#include "base/config/calib_file.h"
#include "base/core/error.h"
#include "base/image/image_files.h"
#include "base/io/file.h"
#include "daemon/recorded/mesh_frames.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"
#include "take/take.h"
#include "tools/test_images.h"
#include "v3dctl/import/import.h"
#include "v3dctl/reconstruct/sharded_reconstruction.h"
#include "v3dctl/reconstruct/take_reconstruction.h"
#include "v3dctl/reconstruct/task_runner.h"

namespace v3d::ctl {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::Pair;
namespace fs = std::filesystem;

/// Makes the shards in this process.
class InlineTaskRunner : public TaskRunner {
 public:
  explicit InlineTaskRunner(ShardFolder folder) : folder_(std::move(folder)) {}

  void start(const std::vector<int64_t>& missing, int64_t /*count*/) override {
    for (const int64_t shard : missing) reconstruct_shards(folder_, {shard, shard + 1}, 2);
  }
  void start_each(const std::vector<take::FrameRange>& /*ranges*/) override {}
  bool poll() override { return false; }
  void cancel() override {}
  std::string failure() const override { return {}; }
  std::string hint() const override { return {}; }

 private:
  const ShardFolder folder_;
};

/// A mask with a square of this many pixels in its middle.
Image square_mask(const RigCamera& camera, int edge) {
  Image mask(camera.model.size(), PixelFormat::kRGB8);
  const int x0 = std::max(0, (mask.size.width - edge) / 2);
  const int y0 = std::max(0, (mask.size.height - edge) / 2);
  const int width = std::min(edge, mask.size.width), height = std::min(edge, mask.size.height);
  for (int y = y0; y < y0 + height; ++y) std::fill_n(mask.row(y) + 3 * x0, 3 * width, 255);
  return mask;
}

/// A take of a small object. The voxels are so small that the space has more bricks than a compact
/// frame can hold.
class OversizedPulse : public testing::Test {
 protected:
  static constexpr int kPulses = 27, kOversized = 25;

  OversizedPulse() {
    const Rig rig = test::small_rig(8);
    save_calib(folder_ / "calib.toml", rig);
    for (const RigCamera& camera : rig) {
      write_pulses(folder_ / "images" / camera.name, test::ball_image(camera),
                   test::ball_image(camera));
      write_pulses(folder_ / "masks" / camera.name, square_mask(camera, 8),
                   square_mask(camera, 64));
    }
    ImportOptions import;
    import.take = request_.take = paths_.folder;
    import.calib = folder_ / "calib.toml";
    import.images = folder_ / "images";
    import.masks = folder_ / "masks";
    import_take(import);
    request_.bounds = Box{{-0.5, -0.5, -0.5}, {0.5, 0.5, 0.5}};
    request_.voxel_m = 0.0023;
    request_.proxy_voxel_m = 0.02;
    request_.frames = {23, kPulses};  // two shards of two pulses
    request_.threads = 2;
  }

  static void write_pulses(const fs::path& folder, const Image& usual, const Image& oversized) {
    fs::create_directories(folder);
    for (int pulse = 0; pulse < kPulses; ++pulse) {
      const Image& image = pulse == kOversized ? oversized : usual;
      write_png(folder / (std::to_string(pulse) + ".png"), image.view());
    }
  }

  ReconstructReport reconstruct_in_shards() const {
    return reconstruct_sharded(request_, 2,
                               [](const ShardFolder& folder, const ReconstructRequest&) {
                                 return std::make_unique<InlineTaskRunner>(folder);
                               });
  }

  const test::TemporaryFolder folder_;
  const take::TakePaths paths_{folder_ / "take"};
  ReconstructRequest request_;
};

TEST_F(OversizedPulse, is_in_neither_mesh_nor_proxy_and_reported) {
  const ReconstructReport report = reconstruct_take(request_);
  EXPECT_EQ(report.frames, 3);
  EXPECT_EQ(report.proxy.at(0).frames, 3);
  EXPECT_EQ(report.incomplete, 0) << "no camera is missing";
  EXPECT_THAT(report.oversized,
              ElementsAre(Pair(kOversized, HasSubstr("does not fit a compact frame"))));
  for (const fs::path& file : {paths_.mesh(), paths_.proxy()}) {
    recorded::MeshFrames meshes(paths_.folder, file);
    EXPECT_THAT(meshes.frames({}), ElementsAre(23, 24, 26)) << file;
    EXPECT_FALSE(meshes.read(26).mesh.vertices.empty()) << file;
  }
}

TEST_F(OversizedPulse, gives_the_same_bytes_and_report_in_shards) {
  const ReconstructReport whole = reconstruct_take(request_);
  const std::string mesh = read_file(paths_.mesh()), proxy = read_file(paths_.proxy());
  const ReconstructReport report = reconstruct_in_shards();
  EXPECT_EQ(read_file(paths_.mesh()), mesh);
  EXPECT_EQ(read_file(paths_.proxy()), proxy);
  EXPECT_EQ(report.frames, whole.frames);
  EXPECT_EQ(report.vertices, whole.vertices);
  EXPECT_EQ(report.oversized, whole.oversized);
}

TEST_F(OversizedPulse, is_rejected_where_the_first_shard_has_no_other) {
  request_.frames = {kOversized, kOversized + 1};
  EXPECT_THAT(test::message_of<InputError>([&] { reconstruct_take(request_); }),
              HasSubstr("pulse 25: a surface of "));
  EXPECT_THAT(test::message_of<InputError>([&] { reconstruct_in_shards(); }),
              HasSubstr("pulse 25: a surface of "));
  EXPECT_FALSE(fs::exists(paths_.mesh()));
}

}  // namespace
}  // namespace v3d::ctl
