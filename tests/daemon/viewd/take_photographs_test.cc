// Photographs of recorded takes, as HTTP responses.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>

#include "base/config/calib_file.h"
#include "base/image/image_files.h"
#include "daemon/viewd/take_pictures.h"
#include "support/child_process.h"
#include "support/open_faults.h"
#include "viewed_site.h"

namespace v3d::viewd {
namespace {

using test::field;
using test::write;
using testing::HasSubstr;
using testing::Not;

/// A take whose cam01 has frames of the pulses 0 to 2, each of one grey.
class PhotographSite : public test::ViewedSite {
 protected:
  static constexpr ImageSize kSize{320, 240};

  PhotographSite() {
    add_frames(take::LogOpening::kNew, 0, 3);
    save_info({"cam00", "cam01"});
  }

  static wire::FrameMessage frame(int64_t pulse) {
    wire::FrameMessage message;
    message.frame.camera = "cam01";
    message.frame.label.pulse = pulse;
    message.frame.sensor_size = kSize;
    message.frame.roi = {0, 0, kSize.width, kSize.height};
    message.frame.image = Image(kSize, PixelFormat::kBayerRG8);
    std::ranges::fill(message.frame.image.bytes, static_cast<uint8_t>(50 + 40 * pulse));
    return message;
  }
  void add_frames(take::LogOpening opening, int64_t first, int64_t end) const {
    take::EventLogWriter log(folder_ / "takes/kendo-07/cam01.lcmlog", opening);
    for (int64_t pulse = first; pulse < end; ++pulse) ASSERT_TRUE(log.write(frame(pulse)));
    ASSERT_TRUE(log.sync());
  }
  static std::optional<Image> picture_of(const web::WebResponse& response) {
    return decode_jpeg(
        {reinterpret_cast<const uint8_t*>(response.body.data()), response.body.size()}, kSize);
  }
};

TEST_F(PhotographSite, serves_the_frame_of_a_camera_at_a_pulse) {
  for (int pulse = 0; pulse < 3; ++pulse) {
    const web::WebResponse response =
        get("/api/takes/kendo-07/photographs/" + std::to_string(pulse) + "/cam01.jpg");
    EXPECT_EQ(response.status, 200);
    EXPECT_EQ(response.type, "image/jpeg");
    const auto picture = picture_of(response);
    ASSERT_TRUE(picture);
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(picture->row(20)[3 * 30 + c], 50 + 40 * pulse, 2);
  }
}

TEST_F(PhotographSite, corrects_colours_by_the_calibration) {
  RigCamera camera{.name = "cam01", .model = {kSize, Eigen::Matrix3d::Identity(), {}, {}}};
  camera.colour.matrix.diagonal() << 2, 1, 0.5;
  save_calib(folder_ / "takes/kendo-07/calib.toml", {camera});
  const auto picture = picture_of(get("/api/takes/kendo-07/photographs/1/cam01.jpg"));
  ASSERT_TRUE(picture);
  EXPECT_NEAR(picture->row(20)[3 * 30], 180, 3);
  EXPECT_NEAR(picture->row(20)[3 * 30 + 2], 45, 3);
}

TEST_F(PhotographSite, answers_304_for_a_matching_etag) {
  WebSite site = this->site();
  web::WebRequest request{.method = "GET",
                          .target = "/api/takes/kendo-07/photographs/1/cam01.jpg",
                          .host = "localhost"};
  const web::WebResponse first = done(site.respond(request));
  EXPECT_EQ(field(first, "Cache-Control"), "no-cache");
  request.if_none_match = field(first, "ETag");
  EXPECT_EQ(done(site.respond(request)).status, 304);
}

TEST_F(PhotographSite, answers_404_for_missing_photographs_and_paths_outside_the_takes) {
  write(folder_ / "cam02.lcmlog", "");
  std::filesystem::create_symlink(folder_ / "takes/kendo-07/cam01.lcmlog",
                                  folder_ / "takes/kendo-07/cam03.lcmlog");
  const std::string of = "/api/takes/kendo-07/photographs/";
  for (const std::string& target :
       {of + "3/cam01.jpg", of + "-1/cam01.jpg", of + "1.5/cam01.jpg", of + "x/cam01.jpg",
        of + "99999999999999999999/cam01.jpg", of + "1/cam02.jpg", of + "1/cam03.jpg",
        of + "1/cam01.png", of + "1/cam01", of + "1/.jpg", of + "1", of + "1/%2e%2e.jpg",
        of + "1/..%2f..%2fcam02.jpg", std::string("/api/takes/none/photographs/1/cam01.jpg"),
        std::string("/api/takes/%2e%2e/photographs/1/cam02.jpg")}) {
    const web::WebResponse response = get(target);
    EXPECT_THAT(response.status, testing::AnyOf(404, 400)) << target;
    EXPECT_EQ(std::ranges::count(response.body, '\n'), 1) << response.body;
    EXPECT_THAT(response.body, Not(HasSubstr(folder_.path().string())));
  }
}

TEST_F(PhotographSite, opens_a_replaced_log_again) {
  WebSite site = this->site();
  const web::WebRequest request{.method = "GET",
                                .target = "/api/takes/kendo-07/photographs/7/cam01.jpg",
                                .host = "localhost"};
  EXPECT_EQ(done(site.respond(request)).status, 404);
  std::filesystem::remove(folder_ / "takes/kendo-07/cam01.lcmlog");
  EXPECT_EQ(done(site.respond(request)).status, 404);
  add_frames(take::LogOpening::kNew, 0, 9);
  EXPECT_EQ(done(site.respond(request)).status, 200);
}

TEST_F(PhotographSite, keeps_no_file_of_a_removed_take_open) {
  WebSite site = this->site();
  const auto response_to = [&](const std::string& target) {
    return done(site.respond({.method = "GET", .target = target, .host = "localhost"}));
  };
  const std::filesystem::path take = folder_ / "takes/kendo-07";
  for (const bool waits_for_a_request : {false, true}) {
    EXPECT_EQ(response_to("/api/takes/kendo-07/thumbnail.jpg").status, 200);
    EXPECT_EQ(response_to("/api/takes/kendo-07/photographs/1/cam01.jpg").status, 200);
    EXPECT_THAT(test::open_files_in(take), testing::SizeIs(1)) << "that of the photograph";
    std::filesystem::remove_all(take);
    if (waits_for_a_request) {
      EXPECT_EQ(response_to("/api/takes/another/photographs/1/cam01.jpg").status, 404);
    } else {
      done(site.closing());
    }
    EXPECT_THAT(test::open_files_in(take), testing::IsEmpty());
    std::filesystem::create_directories(take);
    add_frames(take::LogOpening::kNew, 0, 3);
    save_info({"cam00", "cam01"});
  }
}

TEST_F(PhotographSite, closes_a_log_that_was_not_used_for_long) {
  TakePhotographs photographs(folder_ / "takes");
  EXPECT_TRUE(photographs.read("kendo-07", 1, "cam01"));
  photographs.close_unused(Monotonic::now());
  EXPECT_THAT(test::open_files_in(folder_.path()), testing::SizeIs(1));
  photographs.close_unused(Monotonic::now() + 2 * kMaxUnused);
  EXPECT_THAT(test::open_files_in(folder_.path()), testing::IsEmpty());
  EXPECT_TRUE(photographs.read("kendo-07", 1, "cam01")) << "it is opened again";
}

TEST_F(PhotographSite, finds_frames_recorded_since_the_last_indexing) {
  WebSite site = this->site();
  const web::WebRequest request{.method = "GET",
                                .target = "/api/takes/kendo-07/photographs/3/cam01.jpg",
                                .host = "localhost"};
  EXPECT_EQ(done(site.respond(request)).status, 404);
  add_frames(take::LogOpening::kContinue, 3, 5);
  EXPECT_TRUE(test::becomes_true([&] { return done(site.respond(request)).status == 200; },
                                 test::within(20)));
}

TEST_F(PhotographSite, serves_the_middle_frame_of_a_take_as_a_small_picture) {
  const web::WebResponse response = get("/api/takes/kendo-07/thumbnail.jpg");
  ASSERT_EQ(response.status, 200) << response.body;
  EXPECT_EQ(response.type, "image/jpeg");
  const std::span bytes(reinterpret_cast<const uint8_t*>(response.body.data()),
                        response.body.size());
  const auto size = jpeg_size(bytes);
  ASSERT_TRUE(size);
  EXPECT_LE(std::max(size->width, size->height), TakePhotographs::kMaxThumbnailSide);
  EXPECT_EQ(size->width * kSize.height, size->height * kSize.width);
  const auto picture = decode_jpeg(bytes, *size);
  ASSERT_TRUE(picture);
  EXPECT_NEAR(picture->row(size->height / 2)[3 * (size->width / 2)], 50 + 40 * 1, 2);
}

/// The read calls of this process until now.
int64_t read_calls() {
  std::ifstream io("/proc/self/io");
  for (std::string name; io >> name;) {
    int64_t count = 0;
    io >> count;
    if (name == "syscr:") return count;
  }
  return -1;
}

TEST_F(PhotographSite, makes_a_thumbnail_of_a_long_take_without_reading_its_log) {
  wire::FrameMessage message = frame(0);
  message.frame.sensor_size = {16, 12};
  message.frame.roi = {0, 0, 16, 12};
  message.frame.image = Image({16, 12}, PixelFormat::kBayerRG8);
  std::filesystem::remove(folder_ / "takes/kendo-07/cam01.lcmlog");
  {
    take::EventLogWriter log(folder_ / "takes/kendo-07/cam01.lcmlog");
    for (int64_t pulse = 0; pulse < 2000; ++pulse) {
      message.frame.label.pulse = pulse;
      ASSERT_TRUE(log.write(message));
    }
  }
  const int64_t before = read_calls();
  if (before < 0) GTEST_SKIP() << "the kernel does not count read calls";
  EXPECT_EQ(get("/api/takes/kendo-07/thumbnail.jpg").status, 200);
  EXPECT_LE(read_calls() - before, 40);
}

TEST_F(PhotographSite, makes_thumbnails_while_another_picture_is_made) {
  const auto kind_of = [&](const std::string& target) {
    return site().respond({.method = "GET", .target = target, .host = "localhost"}).kind;
  };
  EXPECT_NE(kind_of("/api/takes/kendo-07/thumbnail.jpg"),
            kind_of("/api/takes/kendo-07/photographs/1/cam01.jpg"));
}

TEST_F(PhotographSite, answers_404_for_a_thumbnail_without_frames) {
  std::filesystem::remove(folder_ / "takes/kendo-07/cam01.lcmlog");
  for (const std::string take : {"kendo-07", "none", "%2e%2e"}) {
    const web::WebResponse response = get("/api/takes/" + take + "/thumbnail.jpg");
    EXPECT_THAT(response.status, testing::AnyOf(404, 400)) << take;
    EXPECT_THAT(response.body, Not(HasSubstr(folder_.path().string())));
  }
}

TEST_F(PhotographSite, survives_a_damaged_log_and_does_not_report_it_as_missing) {
  write(folder_ / "takes/kendo-07/cam01.lcmlog", std::string(5000, 'x'));
  const web::WebResponse response = get("/api/takes/kendo-07/photographs/1/cam01.jpg");
  EXPECT_EQ(response.status, 500);
  EXPECT_THAT(response.body, HasSubstr("cannot be read"));
  EXPECT_THAT(response.body, Not(HasSubstr(folder_.path().string())));
}

TEST_F(PhotographSite, reports_no_picture_as_missing_when_it_cannot_list_the_folder_of_the_take) {
  WebSite site = this->site();
  for (const char* target : {"/api/takes/kendo-07/photographs/1/cam01.jpg",
                             "/api/takes/kendo-07/thumbnail.jpg", "/api/takes/kendo-07/views/1"}) {
    const web::WebResponse deferred =
        site.respond({.method = "GET", .target = target, .host = "localhost"});
    const test::NoDescriptorsLeft none;
    EXPECT_EQ(done(deferred).status, 500) << target;
  }
}

}  // namespace
}  // namespace v3d::viewd
