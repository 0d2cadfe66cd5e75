// The sound of takes that v3d-viewd serves, without sockets.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "support/sounding_take.h"
#include "viewed_site.h"

namespace v3d::viewd {
namespace {

using test::ViewedSite;
using test::write;

TEST_F(ViewedSite, serves_the_sound_of_a_take_and_its_pulses) {
  EXPECT_EQ(get("/api/takes/kendo-07/sound").status, 404) << "the take has no ledger";
  const take::TakePaths take{folder_ / "takes/kendo-07"};
  std::filesystem::remove(take.studio());
  test::write_sounding_take(take, {{{0, 10}, {2, 50}}}, 100, 2, [](int64_t, int) { return 0.5; });
  EXPECT_EQ(get("/api/takes/kendo-07/sound").body,
            R"({"files":[{"audible":[1,2],"channels":2,"file":"sound/cap01.wav",)"
            R"("map":[[0.0,10.0],[2.0,50.0]],"rate_hz":48000,"samples":100}]})");
  const web::WebResponse part = get("/takes/kendo-07/sound/cap01.wav", "bytes=12-15");
  EXPECT_EQ(part.status, 206);
  EXPECT_EQ(part.type, "audio/wav");
  EXPECT_EQ(part.file->size, 4);
}

TEST_F(ViewedSite, serves_no_other_file_beside_the_sound_and_follows_no_link) {
  write(folder_ / "takes/kendo-07/sound/notes.txt", "secret");
  std::filesystem::create_symlink(folder_ / "outside", folder_ / "takes/kendo-07/sound/cap01.wav");
  for (const char* target : {"/takes/kendo-07/sound/notes.txt", "/takes/kendo-07/sound/cap01.wav",
                             "/takes/kendo-07/sound/none.wav", "/takes/kendo-07/sound"}) {
    EXPECT_EQ(get(target).status, 404) << target;
  }
  write(folder_ / "elsewhere/cap01.wav", "secret");
  std::filesystem::create_directory(folder_ / "takes/linking");
  std::filesystem::create_directory_symlink(folder_ / "elsewhere", folder_ / "takes/linking/sound");
  EXPECT_EQ(get("/takes/linking/sound/cap01.wav").status, 404);
}

}  // namespace
}  // namespace v3d::viewd
