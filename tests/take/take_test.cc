#include "take/take.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/core/error.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"

namespace v3d::take {
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

TEST(TakeInfo, is_unchanged_after_saving_and_loading) {
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

TEST(TakeInfo, reports_what_a_folder_lacks_to_be_a_take) {
  const test::TemporaryFolder folder;
  const auto error_message = [](const std::filesystem::path& path) {
    return test::message_of<InputError>([&] { load_take_info({path}); });
  };
  EXPECT_THAT(error_message(folder / "nothing"), testing::HasSubstr("nothing: no such folder"));
  EXPECT_THAT(error_message(folder.path()), testing::HasSubstr("take.toml is missing"));
}

TEST(TakeInfo, that_is_missing_in_a_folder_of_an_interrupted_import_is_reported_as_such) {
  EXPECT_THAT(missing_info_text("/takes/kendo-07.partial-Ab12Cd"),
              testing::HasSubstr("a v3dctl import that was killed has left it"));
  for (const char* folder : {"/takes/kendo-07", "/takes/kendo-07.partial-1", "/takes/a.partial"}) {
    EXPECT_THAT(missing_info_text(folder), testing::HasSubstr("lost+found")) << folder;
  }
}

TEST(TakeInfo, reports_the_invalid_field) {
  const test::TemporaryFolder folder;
  const TakePaths paths{folder.path()};
  const auto error_message_with = [&](auto change) {
    TakeInfo info = some_info();
    change(info);
    EXPECT_TRUE(save_take_info(paths, info));
    return test::message_of<InputError>([&] { load_take_info(paths); });
  };
  EXPECT_THAT(error_message_with([](TakeInfo& i) { i.rate_hz = 0; }),
              testing::HasSubstr(": rate_hz: "));
  EXPECT_THAT(error_message_with([](TakeInfo& i) { i.pulses = -1; }),
              testing::HasSubstr(": pulses: "));
  EXPECT_THAT(error_message_with([](TakeInfo& i) { i.pulses = INT64_MAX; }),
              testing::HasSubstr(": pulses: expected a count, 0 to 10,000,000"));
  EXPECT_THAT(error_message_with([](TakeInfo& i) { i.name = "../x"; }),
              testing::HasSubstr(": name: "));
  EXPECT_THAT(error_message_with([](TakeInfo& i) { i.cameras = {"a/b"}; }),
              testing::HasSubstr(": cameras: "));
  EXPECT_THAT(error_message_with([](TakeInfo& i) { i.state = static_cast<TakeState>(9); }),
              testing::HasSubstr(": state: "));
}

}  // namespace
}  // namespace v3d::take
