#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <bit>
#include <cmath>
#include <limits>

#include "base/config/toml_file.h"

namespace v3d {
namespace {

TEST(TomlWriter, writes_fields_and_tables_in_the_order_of_the_calls) {
  TomlWriter file;
  file.comment("A take.").text("name", "kendo-07").integer("started_ns", 5, "since 1970");
  file.table("space").numbers("min", std::vector<double>{-1.5, 3, 1e-9}).boolean("open", false);
  for (const char* camera : {"cam01", "cam02"}) file.element("camera").text("name", camera);
  file.texts("lines", std::vector<std::string>{"a", "b"})
      .integers("missing", std::vector<int64_t>{7, -8})
      .integers("suspect", {})
      .rows("matrix", std::vector<std::vector<double>>{{1, 2}, {3, 4}});
  EXPECT_EQ(file.written(),
            "# A take.\n"
            "name = 'kendo-07'\n"
            "started_ns = 5  # since 1970\n"
            "\n[space]\n"
            "min = [-1.5, 3.0, 1e-09]\n"
            "open = false\n"
            "\n[[camera]]\n"
            "name = 'cam01'\n"
            "\n[[camera]]\n"
            "name = 'cam02'\n"
            "lines = ['a', 'b']\n"
            "missing = [7, -8]\n"
            "suspect = []\n"
            "matrix = [[1.0, 2.0], [3.0, 4.0]]\n");
}

TEST(TomlWriter, escapes_text_so_that_it_reads_back) {
  const std::vector<std::string> texts{"", "\"", "\\", "a\nb\t\x01\x7F", "# no comment", "\u00e9"};
  const std::string written = TomlWriter().texts("texts", texts).written();
  EXPECT_EQ(TomlTable::parse(written, "test.toml").texts("texts"), texts);
}

RC_GTEST_PROP(TomlWriter, writes_numbers_that_read_back_to_the_same_bits, (uint64_t bits)) {
  const auto number = std::bit_cast<double>(bits);
  RC_PRE(std::isfinite(number));
  const std::string written = TomlWriter().number("x", number).written();
  const double read = TomlTable::parse(written, "test.toml").number("x");
  RC_ASSERT(std::bit_cast<uint64_t>(read) == bits);
}

}  // namespace
}  // namespace v3d
