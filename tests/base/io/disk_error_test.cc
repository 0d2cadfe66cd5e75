#include "base/io/disk_error.h"

#include <gtest/gtest.h>

#include <cerrno>
#include <stdexcept>

#include "base/core/error.h"

namespace v3d::io {
namespace {

bool is_bad_input(int code) {
  try {
    throw_creation_error({code, "cannot create a file"});
  } catch (const InputError&) {
    return true;
  } catch (const std::runtime_error&) {
    return false;
  }
}

TEST(CreationError, is_bad_input_where_another_name_would_be_right) {
  for (const int code : {ENOENT, EEXIST, EACCES, EISDIR}) EXPECT_TRUE(is_bad_input(code)) << code;
}

TEST(CreationError, of_a_full_or_faulty_disk_is_no_bad_input) {
  for (const int code : {ENOSPC, EDQUOT, EIO}) EXPECT_FALSE(is_bad_input(code)) << code;
}

}  // namespace
}  // namespace v3d::io
