#include "take/take.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/core/error.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"

namespace v3d {
namespace {

TakeInfo some_info() {
  return {.name = "kendo-07",
          .studio = "dojo",
          .rate_hz = 25,
          .pulses = 1250,
          .state = TakeState::kComplete,
          .software_version = "0.1.0",
          .started = from_ns<Realtime>(1'700'000'000'123'456'789),
          .cameras = {"cam01", "cam02"}};
}

TEST(TakeInfo, comes_back_from_its_file) {
  const test::TemporaryFolder folder;
  const TakePaths paths{folder.path()};
  for (const TakeState state :
       {TakeState::kRecording, TakeState::kComplete, TakeState::kRecovered}) {
    TakeInfo info = some_info();
    info.state = state;
    EXPECT_TRUE(save_take_info(paths, info));
    const TakeInfo back = load_take_info(paths);
    EXPECT_EQ(back.name, info.name);
    EXPECT_EQ(back.studio, info.studio);
    EXPECT_EQ(back.rate_hz, info.rate_hz);
    EXPECT_EQ(back.pulses, info.pulses);
    EXPECT_EQ(back.state, state);
    EXPECT_EQ(back.software_version, info.software_version);
    EXPECT_EQ(back.started, info.started);
    EXPECT_EQ(back.cameras, info.cameras);
  }
}

TEST(TakeInfo, of_a_folder_that_is_no_take_says_what_is_missing) {
  const test::TemporaryFolder folder;
  const auto refusal = [](const std::filesystem::path& path) {
    return test::message_of<InputError>([&] { load_take_info({path}); });
  };
  EXPECT_THAT(refusal(folder / "nothing"), testing::HasSubstr("nothing: no such folder"));
  EXPECT_THAT(refusal(folder.path()), testing::HasSubstr("take.toml is missing"));
}

TEST(TakeInfo, names_the_field_that_is_wrong) {
  const test::TemporaryFolder folder;
  const TakePaths paths{folder.path()};
  const auto refusal_with = [&](auto change) {
    TakeInfo info = some_info();
    change(info);
    EXPECT_TRUE(save_take_info(paths, info));
    return test::message_of<InputError>([&] { load_take_info(paths); });
  };
  EXPECT_THAT(refusal_with([](TakeInfo& i) { i.rate_hz = 0; }), testing::HasSubstr(": rate_hz: "));
  EXPECT_THAT(refusal_with([](TakeInfo& i) { i.pulses = -1; }), testing::HasSubstr(": pulses: "));
  EXPECT_THAT(refusal_with([](TakeInfo& i) { i.pulses = INT64_MAX; }),
              testing::HasSubstr(": pulses: expected a count, 0 to 10,000,000"));
  EXPECT_THAT(refusal_with([](TakeInfo& i) { i.name = "../x"; }), testing::HasSubstr(": name: "));
  EXPECT_THAT(refusal_with([](TakeInfo& i) { i.cameras = {"a/b"}; }),
              testing::HasSubstr(": cameras: "));
  EXPECT_THAT(refusal_with([](TakeInfo& i) { i.state = static_cast<TakeState>(9); }),
              testing::HasSubstr(": state: "));
}

}  // namespace
}  // namespace v3d
