#include "v3dctl/operate/camera_check.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

namespace v3d::ctl {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;
using testing::StartsWith;
using Grade = CameraVerdict::Grade;

/// A camera that is fit for a take.
CameraSeen fit() {
  CameraSeen seen;
  seen.node = "cap01";
  seen.camera = "cam01";
  seen.pulses = 100;
  seen.received = 100;
  seen.focus = 50;
  seen.plates_focus = 51;
  seen.foreground = 0.001;
  return seen;
}

TEST(Check, is_pleased_with_a_camera_that_is_fit) {
  EXPECT_THAT(check_lines({fit()}),
              ElementsAre(AllOf(StartsWith("good  cam01"), HasSubstr("100/100 frames"),
                                HasSubstr("all well"), Not(HasSubstr("Try")))));
}

/// What judge() says when one thing is spoilt.
CameraVerdict spoilt(const std::function<void(CameraSeen&)>& spoil) {
  CameraSeen seen = fit();
  spoil(seen);
  return judge(seen);
}

TEST(Check, tells_every_fault_by_name_with_its_remedy) {
  const auto expect = [](Grade grade, const char* what, const char* remedy,
                         const std::function<void(CameraSeen&)>& spoil) {
    const CameraVerdict verdict = spoilt(spoil);
    EXPECT_EQ(verdict.grade, grade) << what;
    EXPECT_THAT(verdict.what, HasSubstr(what));
    EXPECT_THAT(verdict.remedy, HasSubstr(remedy));
  };
  expect(Grade::kBad, "not ready", "doctor cap01", [](CameraSeen& s) { s.ready = false; });
  expect(Grade::kBad, "no frame", "trigger cable", [](CameraSeen& s) { s.received = 0; });
  expect(Grade::kBad, "2 frames missing of 100", "network cable",
         [](CameraSeen& s) { s.missing = 2; });
  expect(Grade::kBad, "1 frame with a pulse in doubt", "trigger cable",
         [](CameraSeen& s) { s.suspect = 1; });
  expect(Grade::kLook, "3.0 % too bright", "exposure_us", [](CameraSeen& s) { s.clipped = 0.03; });
  expect(Grade::kBad, "20 % too bright", "exposure_us", [](CameraSeen& s) { s.clipped = 0.2; });
  expect(Grade::kBad, "99 % black", "lens cap", [](CameraSeen& s) { s.dark = 0.99; });
  expect(Grade::kBad, "sharpness 20 %", "focus", [](CameraSeen& s) { s.focus = 10.2; });
  expect(Grade::kLook, "no background", "v3dctl background",
         [](CameraSeen& s) { s.foreground.reset(); });
  expect(Grade::kLook, "4.0 % foreground", "unless somebody",
         [](CameraSeen& s) { s.foreground = 0.04; });
  expect(Grade::kBad, "60 % foreground", "v3dctl background",
         [](CameraSeen& s) { s.foreground = 0.6; });
}

TEST(Check, names_all_faults_and_the_remedy_of_the_worst) {
  const CameraVerdict verdict = spoilt([](CameraSeen& seen) {
    seen.clipped = 0.03;
    seen.missing = 5;
  });
  EXPECT_EQ(verdict.grade, Grade::kBad);
  EXPECT_THAT(verdict.what, AllOf(HasSubstr("missing"), HasSubstr("too bright")));
  EXPECT_THAT(verdict.remedy, HasSubstr("network"));
}

Answer answer_with(const std::string& detail) {
  Answer answer;
  answer.replies["cap01"].detail = detail;
  answer.replies["recon01"];  // has nothing to tell
  return answer;
}

constexpr char kAccount[] = R"({"pulses":{"commanded":20,"sensed":20},"not_ready":["cam02"],
  "checked":[{"name":"cam01","received":19,"missing":[7],"duplicate":[],"suspect":[],
  "clipped":0.0,"dark":0.1,"mean_grey":80.5,"focus":50.0,"plates_focus":null,"foreground":null}]})";

TEST(Check, reads_what_nodes_tell) {
  const CheckFindings findings = read_check(answer_with(kAccount));
  ASSERT_EQ(findings.cameras.size(), 2U);
  EXPECT_EQ(findings.cameras[0].pulses, 20);
  EXPECT_EQ(findings.cameras[0].missing, 1);
  EXPECT_FALSE(findings.cameras[0].foreground);
  EXPECT_FALSE(findings.cameras[1].ready);
  EXPECT_TRUE(findings.unreadable.empty());
  EXPECT_FALSE(all_good(findings));
}

TEST(Check, names_the_node_whose_account_cannot_be_read) {
  for (const char* hostile : {"{", "[]", "7", "{\"checked\":[]}",
                              "{\"pulses\":{\"commanded\":1},\"checked\":[{\"name\":7}],"
                              "\"not_ready\":[]}"}) {
    const CheckFindings findings = read_check(answer_with(hostile));
    EXPECT_THAT(findings.unreadable, ElementsAre("cap01")) << hostile;
    EXPECT_FALSE(all_good(findings));
  }
}

TEST(Check, is_the_same_facts_as_json) {
  const auto json = check_json(read_check(answer_with(kAccount)));
  EXPECT_FALSE(json["good"].get<bool>());
  EXPECT_EQ(json["cameras"][0]["verdict"], "bad");
  EXPECT_TRUE(json["cameras"][0]["foreground"].is_null());
  EXPECT_EQ(json["cameras"][1]["text"], "not ready");
}

}  // namespace
}  // namespace v3d::ctl
