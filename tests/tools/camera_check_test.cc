#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "v3dctl/operate/camera_report.h"

namespace v3d::ctl {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;
using testing::StartsWith;
using Grade = CameraVerdict::Grade;

/// A camera without a fault.
CameraMeasurement good_camera() {
  CameraMeasurement camera;
  camera.node = "cap01";
  camera.camera = "cam01";
  camera.pulses = 100;
  camera.received = 100;
  camera.focus = 50;
  camera.plates_focus = 51;
  camera.foreground = 0.001;
  return camera;
}

TEST(CameraCheck, finds_no_fault_in_a_good_camera) {
  EXPECT_THAT(check_lines({good_camera()}),
              ElementsAre(AllOf(StartsWith("good  cam01"), HasSubstr("100/100 frames"),
                                HasSubstr("all well"), Not(HasSubstr("Try")))));
}

/// Verdict about a camera with one changed measurement.
CameraVerdict verdict_with(const std::function<void(CameraMeasurement&)>& change) {
  CameraMeasurement camera = good_camera();
  change(camera);
  return judge(camera);
}

TEST(CameraCheck, reports_every_fault_with_its_remedy) {
  const auto expect = [](Grade grade, const char* what, const char* remedy,
                         const std::function<void(CameraMeasurement&)>& change) {
    const CameraVerdict verdict = verdict_with(change);
    EXPECT_EQ(verdict.grade, grade) << what;
    EXPECT_THAT(verdict.what, HasSubstr(what));
    EXPECT_THAT(verdict.remedy, HasSubstr(remedy));
  };
  expect(Grade::kBad, "not ready", "doctor cap01", [](CameraMeasurement& s) { s.ready = false; });
  expect(Grade::kBad, "no frame", "trigger cable", [](CameraMeasurement& s) { s.received = 0; });
  expect(Grade::kBad, "2 frames missing of 100", "network cable",
         [](CameraMeasurement& s) { s.missing = 2; });
  expect(Grade::kBad, "3 frames not examined of 100 pulses; 1 frame missing", "cap01 is too busy",
         [](CameraMeasurement& s) {
           s.missing = 4;
           s.dropped = 3;
         });
  expect(Grade::kBad, "1 frame with a pulse in doubt", "trigger cable",
         [](CameraMeasurement& s) { s.suspect = 1; });
  expect(Grade::kLook, "3.0 % too bright", "exposure_us",
         [](CameraMeasurement& s) { s.clipped = 0.03; });
  expect(Grade::kBad, "20 % too bright", "exposure_us",
         [](CameraMeasurement& s) { s.clipped = 0.2; });
  expect(Grade::kBad, "99 % black", "lens cap", [](CameraMeasurement& s) { s.dark = 0.99; });
  expect(Grade::kBad, "sharpness 20 %", "focus", [](CameraMeasurement& s) { s.focus = 10.2; });
  expect(Grade::kLook, "light flickers by 3.0 % at 5 Hz", "rate_hz = 24 under [trigger]",
         [](CameraMeasurement& s) {
           s.flicker_amplitude = 0.03;
           s.beat_hz = 5;
           s.rate_without_flicker_hz = 24;
         });
  expect(Grade::kBad, "light flickers by 8.0 % at 7 Hz", "lamps without flicker",
         [](CameraMeasurement& s) {
           s.flicker_amplitude = 0.08;
           s.beat_hz = 7;
         });
  expect(Grade::kLook, "no background", "v3dctl background",
         [](CameraMeasurement& s) { s.foreground.reset(); });
  expect(Grade::kLook, "4.0 % foreground", "unless a person",
         [](CameraMeasurement& s) { s.foreground = 0.04; });
  expect(Grade::kBad, "60 % foreground", "v3dctl background",
         [](CameraMeasurement& s) { s.foreground = 0.6; });
}

TEST(CameraCheck, tolerates_a_flicker_that_no_picture_shows) {
  const CameraVerdict verdict = verdict_with([](CameraMeasurement& camera) {
    camera.flicker_amplitude = 0.005;
    camera.beat_hz = 5;
  });
  EXPECT_EQ(verdict.grade, Grade::kGood);
}

TEST(CameraCheck, reports_all_faults_and_the_remedy_of_the_worst) {
  const CameraVerdict verdict = verdict_with([](CameraMeasurement& camera) {
    camera.clipped = 0.03;
    camera.missing = 5;
  });
  EXPECT_EQ(verdict.grade, Grade::kBad);
  EXPECT_THAT(verdict.what, AllOf(HasSubstr("missing"), HasSubstr("too bright")));
  EXPECT_THAT(verdict.remedy, HasSubstr("network"));
}

control::Answer answer_with(const std::string& detail) {
  control::Answer answer;
  answer.replies["cap01"].detail = detail;
  answer.replies["recon01"];  // a reconstruction node has no detail
  return answer;
}

constexpr char kReply[] = R"({"pulses":{"commanded":20,"sensed":20},"not_ready":["cam02"],
  "checked":[{"name":"cam01","received":19,"missing":[7],"duplicate":[],"suspect":[],
  "clipped":0.0,"dark":0.1,"mean_grey":80.5,"focus":50.0,"plates_focus":null,"foreground":null}]})";

TEST(CameraCheck, parses_the_replies_of_nodes) {
  const CheckReport report = parse_check_replies(answer_with(kReply));
  ASSERT_EQ(report.cameras.size(), 2U);
  EXPECT_EQ(report.cameras[0].pulses, 20);
  EXPECT_EQ(report.cameras[0].missing, 1);
  EXPECT_FALSE(report.cameras[0].foreground);
  EXPECT_FALSE(report.cameras[1].ready);
  EXPECT_TRUE(report.unreadable.empty());
  EXPECT_FALSE(all_good(report));
}

TEST(CameraCheck, reads_the_counts_of_lists_that_a_node_has_cut_off) {
  std::string reply(kReply);
  const std::string list = "\"missing\":[7]";
  reply.replace(reply.find(list), list.size(), list + ",\"missing_count\":100000");
  EXPECT_EQ(parse_check_replies(answer_with(reply)).cameras.at(0).missing, 100000);
}

TEST(CameraCheck, reads_the_flicker_of_each_camera) {
  std::string reply(kReply);
  const std::string last = "\"foreground\":null";
  reply.replace(reply.find(last), last.size(),
                last +
                    ",\"flicker_amplitude\":0.02,\"beat_hz\":5.0,"
                    "\"rate_without_flicker_hz\":null");
  const auto json = check_json(parse_check_replies(answer_with(reply)));
  EXPECT_EQ(json["cameras"][0]["flicker_amplitude"], 0.02);
  EXPECT_EQ(json["cameras"][0]["beat_hz"], 5.0);
  EXPECT_TRUE(json["cameras"][0]["rate_without_flicker_hz"].is_null());
}

/// Sound at cap02, and motion that stops before cam01 at cap01.
CheckReport report_with_sound(const std::string& sound) {
  std::string reply(kReply);
  const std::string last = "\"foreground\":null";
  reply.replace(reply.find(last), last.size(),
                last + ",\"motion_stops\":[[1.5,9.0],[11.5,2.0],[12.0,1.0]]");
  control::Answer answer = answer_with(reply);
  answer.replies["cap02"].detail =
      R"({"pulses":{"commanded":20,"sensed":20,"rate_hz":20.0},"not_ready":[],"checked":[],"sound":)" +
      sound + "}";
  return parse_check_replies(answer);
}

TEST(CameraCheck, compares_a_clap_with_the_pictures_of_all_nodes) {
  const CheckReport report =
      report_with_sound(R"({"fault":"","clap_pulse":12.0,"uncertainty_us":1000.0})");
  EXPECT_THAT(report.unreadable, ElementsAre());
  EXPECT_THAT(sound_lines(report.sounds),
              ElementsAre("sound of cap02: clap at pulse 12.00; the sound is 25 ms later than the "
                          "pictures, +-26 ms, by 1 camera (cam01 +25 ms)"));
  const auto json = check_json(report)["sounds"][0];
  EXPECT_EQ(json["node"], "cap02");
  EXPECT_NEAR(json["offset_ms"], 25, 1e-9);
  EXPECT_NEAR(json["uncertainty_ms"], 26, 1e-9);
  EXPECT_EQ(json["cameras"][0]["name"], "cam01");
  EXPECT_NEAR(json["cameras"][0]["offset_ms"], 25, 1e-9);
}

TEST(CameraCheck, reports_a_missing_clap_and_a_failed_detection) {
  const CheckReport silent =
      report_with_sound(R"({"fault":"","clap_pulse":null,"uncertainty_us":0.0})");
  EXPECT_THAT(sound_lines(silent.sounds), ElementsAre("sound of cap02: no clap found"));
  EXPECT_TRUE(check_json(silent)["sounds"][0]["offset_ms"].is_null());
  EXPECT_EQ(all_good(silent), all_good(parse_check_replies(answer_with(kReply))))
      << "a clap is no condition of a take";
  const CheckReport faulty = report_with_sound(
      R"({"fault":"no sound came from hw:0","clap_pulse":null,"uncertainty_us":0})");
  EXPECT_THAT(sound_lines(faulty.sounds), ElementsAre("sound of cap02: no sound came from hw:0"));
  const CheckReport unseen =
      report_with_sound(R"({"fault":"","clap_pulse":50.0,"uncertainty_us":0})");
  EXPECT_THAT(sound_lines(unseen.sounds),
              ElementsAre(HasSubstr("no camera shows a motion that stops there")));
  EXPECT_THAT(report_with_sound("7").unreadable, ElementsAre("cap02"));
}

TEST(CameraCheck, names_a_node_whose_reply_cannot_be_parsed) {
  for (const char* malformed : {"{", "[]", "7", "{\"checked\":[]}",
                                "{\"pulses\":{\"commanded\":1},\"checked\":[{\"name\":7}],"
                                "\"not_ready\":[]}"}) {
    const CheckReport report = parse_check_replies(answer_with(malformed));
    EXPECT_THAT(report.unreadable, ElementsAre("cap01")) << malformed;
    EXPECT_FALSE(all_good(report));
  }
}

TEST(CameraCheck, has_the_same_content_as_json) {
  const auto json = check_json(parse_check_replies(answer_with(kReply)));
  EXPECT_FALSE(json["good"].get<bool>());
  EXPECT_EQ(json["cameras"][0]["verdict"], "bad");
  EXPECT_TRUE(json["cameras"][0]["foreground"].is_null());
  EXPECT_EQ(json["cameras"][1]["text"], "not ready");
}

}  // namespace
}  // namespace v3d::ctl
