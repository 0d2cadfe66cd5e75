// Messages for fields of a studio file that are required beside others.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/config/studio_file.h"
#include "base/core/error.h"
#include "support/message_of.h"
#include "support/studio_text.h"

namespace v3d {
namespace {

using testing::EndsWith;

std::string message_for(const std::string& text) {
  return test::message_of<InputError>([&] { parse_studio(text, "studio.toml"); });
}

std::string studio_with_trigger(const std::string& fields) {
  return test::studio_text({{"cap01", {"cam01"}}}, fields);
}

/// `defaults`: fields of [camera_defaults]; `own`: of the camera.
std::string studio_with_camera(const std::string& defaults, const std::string& own) {
  std::string text = test::studio_text({{"cap01", {"cam01"}}});
  return text.replace(text.find("name = 'cam01'\n"), 0, own) + "[camera_defaults]\n" + defaults;
}

TEST(MissingField, of_a_line_names_what_is_right) {
  const std::string expected =
      "missing: expected the name or the number of a line, as gpioinfo lists them";
  EXPECT_THAT(message_for(studio_with_trigger("kind = 'gpio'\nchip = 'gpiochip0'")),
              EndsWith(": trigger.line: " + expected));
  EXPECT_THAT(message_for(studio_with_trigger("kind = 'gpio'\nchip = 'gpiochip0'\nline = 4\n"
                                              "[trigger.sense]\nchip = 'gpiochip0'")),
              EndsWith(": trigger.sense.line: " + expected));
}

TEST(MissingField, of_a_signal_generator_names_the_known_dialects) {
  EXPECT_THAT(message_for(studio_with_trigger("kind = 'scpi'\ninstrument = 'usb:1ab1:0642'")),
              EndsWith(": trigger.dialect: missing; known: keysight33500, rigol-dg, siglent-sdg, "
                       "bnc575"));
}

TEST(MissingField, of_a_region_names_both_sides) {
  const std::string expected = "missing: expected width and height of the region, in pixels";
  EXPECT_THAT(message_for(studio_with_camera("", "width = 640\n")),
              EndsWith(": camera.height: " + expected));
  EXPECT_THAT(message_for(studio_with_camera("", "height = 480\n")),
              EndsWith(": camera.width: " + expected));
  EXPECT_THAT(message_for(studio_with_camera("width = 640\n", "")),
              EndsWith(": camera_defaults.height: " + expected));
}

TEST(MissingField, of_a_region_is_that_of_the_defaults) {
  const Studio studio = parse_studio(
      studio_with_camera("width = 640\nheight = 480\n", "height = 400\n"), "studio.toml");
  EXPECT_EQ(studio.cameras.at(0).size, (ImageSize{640, 400}));
}

}  // namespace
}  // namespace v3d
