#include "v3dctl/setup/node_settings.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "base/core/error.h"
#include "support/studio_text.h"

namespace v3d::ctl {
namespace {

using testing::HasSubstr;

constexpr size_t kLong = 200'000;  // a regular expression of the C++ library overflows the stack

/// The text, in which each `line` ends in a long comment.
std::string with_long_comments(std::string text, const std::string& line) {
  const std::string comment = " # " + std::string(kLong, 'x');
  for (size_t at = text.find(line + "\n"); at != std::string::npos;
       at = text.find(line + "\n", at + line.size() + comment.size())) {
    text.insert(at + line.size(), comment);
  }
  return text;
}

/// The text of a studio file with the nodes cap01 and cap02 and with long lines.
std::string long_studio_text() {
  std::string text = test::studio_text({{"cap01", {"cam01"}}, {"cap02", {"cam02"}}});
  for (const char* line : {"[[node]]", "name = 'cap01'", "name = 'cap02'", "[trigger]"}) {
    text = with_long_comments(text, line);
  }
  text.insert(text.rfind("[[node]]"), std::string(kLong, ' ') + "\n");
  return text;
}

TEST(NodeSettings, enter_a_key_into_a_studio_file_with_long_lines) {
  const std::string key(64, 'a'), other(64, 'b');
  const std::string line = "public_key = \"" + key + "\"";
  const std::string text = with_node(long_studio_text(), "studio.toml", "cap02", key);
  ASSERT_THAT(text, HasSubstr("\n" + line + "\n"));
  EXPECT_GT(text.find(line), text.find("name = 'cap02'"));
  EXPECT_LT(text.find(line), text.find("[trigger]"));
  const std::string changed =
      with_node(with_long_comments(text, line), "studio.toml", "cap02", other);
  EXPECT_THAT(changed, HasSubstr("\npublic_key = \"" + other + "\"\n"));
  EXPECT_EQ(changed.find(key), std::string::npos);
}

TEST(NodeSettings, have_names_and_addresses_of_time_servers) {
  EXPECT_EQ(time_servers_text({"ntp.studio", "192.168.1.1", "fd00::1", "0.a-b"}),
            "ntp.studio\n192.168.1.1\nfd00::1\n0.a-b\n");
  const std::string longest(253, 'a');
  EXPECT_EQ(time_servers_text({longest}), longest + "\n");
  for (const char* bad : {"", ".a", "-a", ":1", "ntp studio", "a\n", "a_b"}) {
    EXPECT_THROW(time_servers_text({bad}), InputError) << bad;
  }
}

TEST(NodeSettings, have_no_time_server_with_a_name_that_is_too_long) {
  for (const size_t length : {size_t{254}, kLong}) {
    try {
      time_servers_text({std::string(length, 'a')});
      FAIL() << length;
    } catch (const InputError& error) {
      EXPECT_THAT(error.what(), HasSubstr("at most 253"));
      EXPECT_LT(std::string(error.what()).size(), 200U);
    }
  }
}

TEST(NodeSettings, have_the_name_of_a_host) {
  for (const std::string& good : {std::string("c"), std::string("cap-07"), std::string(63, 'a')}) {
    EXPECT_NO_THROW(require_host_name(good)) << good;
  }
  for (const std::string& bad :
       {std::string(), std::string("-a"), std::string("a-"), std::string("Cap01"),
        std::string("a.b"), std::string(64, 'a'), std::string(kLong, 'a')}) {
    EXPECT_THROW(require_host_name(bad), InputError) << bad.size();
  }
}

}  // namespace
}  // namespace v3d::ctl
