#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "support/temporary_folder.h"
#include "tools/gliding_take.h"
#include "v3dctl/evaluate/evaluate.h"

namespace v3d::ctl {
namespace {

using testing::HasSubstr;
namespace fs = std::filesystem;

/// Meshes of pulses 0 to 5, and others of a part of them.
class EvaluationPages : public testing::Test {
 protected:
  std::string page_beside(int first, int last) {
    const fs::path take = folder_ / "take", other = folder_ / "other.v3d";
    test::write_gliding_take(take);
    test::write_gliding_motion(other, first, last);
    EvaluationPage page;
    page.columns = {{"take", {take}, {}, {}}, {"other", {take, other}, {}, {}}};
    return evaluation_html(page);
  }
  const test::TemporaryFolder folder_;
};

TEST_F(EvaluationPages, show_a_frame_that_all_meshes_have) {
  EXPECT_THAT(page_beside(1, 3), HasSubstr("6 frames, images of frame 2."));
}

TEST_F(EvaluationPages, have_no_images_where_no_frame_is_common) {
  EXPECT_THAT(page_beside(7, 9), HasSubstr("6 frames; no images, because no frame is in all"));
}

}  // namespace
}  // namespace v3d::ctl
