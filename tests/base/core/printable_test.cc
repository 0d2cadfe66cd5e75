#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include "base/core/text.h"

namespace v3d {
namespace {

TEST(Printable, keeps_utf8_text_of_any_language) {
  for (const char* text : {"", "cam07: lost", "Köln 25 °C", "剣道-07", "\xF0\x9F\x8E\xA5"}) {
    EXPECT_EQ(printable(text), text);
  }
}

TEST(Printable, replaces_control_characters) {
  EXPECT_EQ(printable("\x1b[2J"), "?[2J");
  EXPECT_EQ(printable("a\nb\tc\x7f"), "a?b?c?");
  EXPECT_EQ(printable("\xC2\x9B"
                      "31m"),
            "?31m")
      << "CSI as one character";
  EXPECT_EQ(printable(std::string(1, '\0')), "?");
}

TEST(Printable, replaces_every_byte_of_invalid_utf8) {
  EXPECT_EQ(printable("K\xF6ln"), "K?ln") << "Latin-1";
  EXPECT_EQ(printable("\xC0\xAF"), "??") << "a slash in two bytes";
  EXPECT_EQ(printable("\xED\xA0\x80"), "???") << "half of a surrogate pair";
  EXPECT_EQ(printable("\xF4\x90\x80\x80"), "????") << "beyond Unicode";
  EXPECT_EQ(printable("\xE5\x89"), "??") << "cut off";
}

TEST(Printable, keeps_the_line_ends_of_a_text_of_several_lines) {
  EXPECT_EQ(printable_text("refused\ncam01: \x1b[2J\n"), "refused\ncam01: ?[2J\n");
  EXPECT_EQ(printable_text(""), "");
}

RC_GTEST_PROP(Printable, is_idempotent, (const std::string& text)) {
  const std::string once = printable(text);
  RC_ASSERT(printable(once) == once);
}

}  // namespace
}  // namespace v3d
