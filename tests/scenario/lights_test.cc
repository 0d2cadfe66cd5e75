// The lamps of a studio, by OLA's daemon, during background and take.
#include <gmock/gmock.h>
#include <signal.h>

#include "studio4.h"
#include "support/olad.h"

namespace v3d::test {
namespace {

using testing::ElementsAre;

constexpr char kWork[] = "0xff 0x0 ", kTake[] = "0xa 0x14 ";
constexpr int64_t kPulses = 40;

struct WithOlad {
  Olad olad_;
};

/// A background is learnt before the test begins. The daemon may connect only afterwards.
class LitStudio : protected WithOlad, public Studio4 {
 protected:
  LitStudio() : Studio4({.more = "[lights]\nwork = [255, 0]\ntake = [10, 20]\n"}) {}
};

TEST_F(LitStudio, has_the_take_light_for_its_background_and_from_arming_to_the_end_of_a_take) {
  ASSERT_TRUE(reaches("cap01", "lights_connected_flag", 1)) << log();
  ASSERT_TRUE(olad_.becomes(kWork));
  const control::Answer learnt = command(wire::CommandVerb::kBackground, kPulses);
  ASSERT_TRUE(learnt.done()) << text_of(learnt) << log();
  ASSERT_TRUE(olad_.becomes(kWork));
  arm_and_start(0);
  ASSERT_TRUE(olad_.becomes(kTake));
  ASSERT_TRUE(reaches("cap01", "frames_written", 20)) << log();
  ASSERT_TRUE(command(wire::CommandVerb::kStop).done()) << log();
  ASSERT_TRUE(olad_.becomes(kWork));
  EXPECT_EQ(load_take_info(take()).state, take::TakeState::kComplete);
  const auto scenes = olad_.scenes();
  ASSERT_GE(scenes.size(), 5U);
  EXPECT_THAT(std::vector(scenes.end() - 5, scenes.end()),
              ElementsAre(kWork, kTake, kWork, kTake, kWork));
}

/// The lamps are on the node that has two cameras and no trigger.
class LitStudioOfTwoNodes : protected WithOlad, public Studio4 {
 protected:
  LitStudioOfTwoNodes()
      : Studio4({.more = "[lights]\nnode = 'cap02'\nwork = [255, 0]\ntake = [10, 20]\n",
                 .two_nodes = true}) {}
};

TEST_F(LitStudioOfTwoNodes, has_the_take_light_again_when_the_node_was_killed_in_the_take) {
  arm_and_start(0);
  ASSERT_TRUE(reaches("cap02", "frames_written", 20)) << log();
  second_captured_->signal(SIGKILL);
  second_captured_->wait(within(30));
  start_second_captured();
  client_.emplace(studio_);  // without the health from before
  ASSERT_TRUE(reaches("cap02", "take_light_flag", 1)) << log();
  ASSERT_TRUE(reaches("cap02", "lights_connected_flag", 1)) << log();
  EXPECT_TRUE(olad_.becomes(kTake)) << log();
  EXPECT_TRUE(command(wire::CommandVerb::kStop).done()) << log();
  EXPECT_TRUE(olad_.becomes(kWork));
}

class DarkStudio : public Studio4 {
 protected:
  DarkStudio() : Studio4({.more = "[lights]\nwork = [255, 0]\ntake = [10, 20]\n"}) {}
};

TEST_F(DarkStudio, records_its_take_and_states_that_olad_does_not_answer) {
  EXPECT_TRUE(becomes_true(
      [&] { return log().find("olad does not answer on port 9010") != std::string::npos; },
      within(60)))
      << log();
  EXPECT_TRUE(
      becomes_true([&] { return value("cap01", "lights_connected_flag") == 0; }, within(60)));
  arm_and_start(kPulses);
  ASSERT_TRUE(becomes_idle()) << log();
  EXPECT_EQ(load_take_info(take()).state, take::TakeState::kComplete);
}

}  // namespace
}  // namespace v3d::test
