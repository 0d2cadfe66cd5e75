// GPIO lines without a chip. Compiled against libgpiod 1.6 on Debian 12, and libgpiod 2 on
// Debian 13.
#include "trigger/gpio_lines.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/core/error.h"
#include "support/message_of.h"

namespace v3d::trigger {
namespace {

using testing::AllOf;
using testing::HasSubstr;

TEST(GpioLines, are_numbers_or_names) {
  EXPECT_EQ(number_of({.chip = "gpiochip0", .line = "17"}), 17U);
  for (const char* name : {"TRIGGER", "", "17a", "-1", "99999999999"}) {
    EXPECT_EQ(number_of({.chip = "gpiochip0", .line = name}), std::nullopt) << name;
  }
  EXPECT_EQ(line_text({.chip = "gpiochip0", .line = "17"}), "17 of gpiochip0");
}

TEST(GpioLines, of_an_absent_chip_are_rejected_with_its_name_and_a_remedy) {
  for (const char* chip : {"/nonexistent/chip", "gpiochip99", "99", "no such label", "/dev/null"}) {
    const StudioLine line{.chip = chip, .line = "3"};
    const auto expected =
        AllOf(HasSubstr("GPIO chip " + line.chip + ": "), HasSubstr("gpiodetect lists the chips"));
    EXPECT_THAT(test::message_of<InputError>([&] { open_output_line(line); }), expected);
    EXPECT_THAT(test::message_of<InputError>([&] { open_input_line(line); }), expected);
  }
}

}  // namespace
}  // namespace v3d::trigger
