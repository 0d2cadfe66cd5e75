// Lamps of OLA's daemon with a simulated DMX interface.
#include "daemon/captured/light_output.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "support/olad.h"

namespace v3d::captured {
namespace {

using Scene = LightOutput::Scene;
using testing::ElementsAre;
using testing::HasSubstr;

const StudioLights kLights{
    .node = "cap01", .work = {255, 0}, .take = {10, 20}, .settle_ms = 3'600'000};
constexpr char kWork[] = "0xff 0x0 ", kTake[] = "0xa 0x14 ";

bool connects(const LightOutput& lights) {
  return test::becomes_true([&] { return lights.status().is_connected; }, test::within(60));
}
bool has_fault(const LightOutput& lights, const std::string& text) {
  return test::becomes_true([&] { return lights.status().fault.find(text) != std::string::npos; },
                            test::within(60));
}

TEST(LightOutput, shows_the_work_light_then_the_take_light_and_the_work_light_at_its_end) {
  const test::Olad olad;
  {
    LightOutput lights(kLights, V3D_LIGHTS, std::chrono::minutes(1));
    ASSERT_TRUE(connects(lights)) << lights.status().fault;
    ASSERT_TRUE(olad.becomes(kWork));
    lights.show(Scene::kTake);
    ASSERT_TRUE(olad.becomes(kTake));
    EXPECT_EQ(lights.status().scene, Scene::kTake);
  }
  EXPECT_TRUE(olad.becomes(kWork));
  EXPECT_THAT(olad.scenes(), ElementsAre(kWork, kTake, kWork));
}

TEST(LightOutput, is_settled_when_the_lamps_have_had_their_time_after_a_change) {
  StudioLights lights = kLights;
  LightOutput slow(lights, V3D_LIGHTS);
  EXPECT_TRUE(slow.is_settled()) << "nothing has changed";
  slow.show(Scene::kWork);
  EXPECT_TRUE(slow.is_settled()) << "the scene is the same";
  slow.show(Scene::kTake);
  EXPECT_FALSE(slow.is_settled());
  lights.settle_ms = 0;
  LightOutput quick(lights, V3D_LIGHTS);
  quick.show(Scene::kTake);
  EXPECT_TRUE(quick.is_settled());
}

TEST(LightOutput, states_that_olad_does_not_answer_and_shows_the_scene_when_it_does) {
  LightOutput lights(kLights, V3D_LIGHTS);
  EXPECT_TRUE(has_fault(lights, "olad does not answer on port 9010 of this PC"));
  EXPECT_FALSE(lights.status().is_connected);
  lights.show(Scene::kTake);
  const test::Olad olad;
  ASSERT_TRUE(connects(lights));
  EXPECT_EQ(lights.status().fault, "");
  EXPECT_TRUE(olad.becomes(kTake));
}

TEST(LightOutput, states_that_an_olad_that_hangs_does_not_answer_and_continues_when_it_does) {
  test::Olad olad;
  LightOutput lights(kLights, V3D_LIGHTS);
  ASSERT_TRUE(connects(lights));
  ASSERT_TRUE(olad.becomes(kWork));
  olad.set_suspended(true);
  EXPECT_TRUE(has_fault(lights, "olad does not answer on port 9010 of this PC"));
  EXPECT_FALSE(lights.status().is_connected);
  lights.show(Scene::kTake);
  olad.set_suspended(false);
  ASSERT_TRUE(connects(lights));
  EXPECT_TRUE(olad.becomes(kTake));
}

TEST(LightOutput, names_a_universe_that_olad_does_not_have) {
  StudioLights lights = kLights;
  lights.universe = 7;
  const test::Olad olad;
  const LightOutput output(lights, V3D_LIGHTS);
  EXPECT_TRUE(has_fault(output, "(universe 7)")) << output.status().fault;
}

TEST(LightOutput, names_a_program_that_is_not_installed) {
  const LightOutput lights(kLights, "/nowhere/v3d-lights");
  EXPECT_TRUE(has_fault(lights, "cannot start /nowhere/v3d-lights: No such file"))
      << lights.status().fault;
}

}  // namespace
}  // namespace v3d::captured
