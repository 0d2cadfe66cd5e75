#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/core/error.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"
#include "take/take.h"
#include "tools/imported_ball.h"
#include "v3dctl/reconstruct/reconstruct_options.h"
#include "v3dctl/reconstruct/reconstruct_request.h"
#include "v3dctl/reconstruct/take_reconstruction.h"

namespace v3d::ctl {
namespace {

using testing::AllOf;
using testing::HasSubstr;

/// A take that belongs to no studio.
class QualityOptions : public testing::Test {
 protected:
  QualityOptions() {
    request_.take = folder_ / "take";
    test::import_ball(folder_.path(), 8, request_.take);
    request_.bounds = Box{{-0.5, -0.5, -0.5}, {0.5, 0.5, 0.5}};
    request_.voxel_m = 0.02;
    request_.threads = 2;
  }

  static ReconstructRequest complete(const ReconstructRequest& request) {
    return with_defaults(request, open_take(request));
  }
  static std::string rejection(const ReconstructRequest& request) {
    return test::message_of<InputError>([&] { complete(request); });
  }

  const test::TemporaryFolder folder_;
  ReconstructRequest request_;
};

TEST_F(QualityOptions, reject_passes_where_neither_mesh_nor_proxy_has_medium_quality) {
  parse_passes("3", {request_.take}, request_);
  EXPECT_THAT(rejection(request_),
              AllOf(HasSubstr("--passes: "), HasSubstr("the quality is live; expected --quality "
                                                       "medium")));
  request_.quality = Quality::kHigh;
  EXPECT_THAT(rejection(request_), HasSubstr("the quality is high"));
  request_.proxy_voxel_m = 0.05;
  request_.proxy_quality = Quality::kMedium;
  EXPECT_EQ(options_of(complete(request_), 1).live_passes, 3);
  request_.proxy_voxel_m.reset();
  request_.proxy_quality.reset();
  request_.quality = Quality::kMedium;
  EXPECT_EQ(options_of(complete(complete(request_)), 1).live_passes, 3);
}

TEST_F(QualityOptions, reject_the_passes_of_live_meshes_instead_of_replacing_these_by_hulls) {
  ReconstructRequest medium = request_;
  medium.quality = Quality::kMedium;
  reconstruct_take(medium);
  parse_passes("live", {request_.take}, request_);
  EXPECT_THAT(rejection(request_), HasSubstr("--passes: "));
  request_.quality = Quality::kMedium;
  EXPECT_NO_THROW(complete(request_));
}

TEST_F(QualityOptions, reject_parameters_of_the_deformation_without_high_quality) {
  request_.deform = parse_deform("window=7");
  for (const Quality quality : {Quality::kLive, Quality::kMedium}) {
    request_.quality = quality;
    EXPECT_THAT(rejection(request_),
                AllOf(HasSubstr("--deform: "), HasSubstr("expected --quality high")));
  }
  request_.quality = Quality::kHigh;
  EXPECT_EQ(options_of(complete(request_), 1).deform.window, 7);
}

TEST_F(QualityOptions, have_defaults_with_every_quality) {
  for (const Quality quality : {Quality::kLive, Quality::kMedium, Quality::kHigh}) {
    request_.quality = quality;
    const recon::ReconstructOptions options = options_of(complete(request_), 1);
    EXPECT_EQ(options.live_passes, recon::kDefaultLivePasses);
    EXPECT_EQ(options.deform.window, recon::DeformOptions().window);
  }
}

}  // namespace
}  // namespace v3d::ctl
