// The message of an expected exception.
#pragma once

#include <gtest/gtest.h>

#include <string>

namespace v3d::test {

/// The message of the E that `call` throws; fails the test when it throws none.
template <class E, class Call>
std::string message_of(Call call) {
  try {
    call();
  } catch (const E& error) {
    return error.what();
  }
  ADD_FAILURE() << "nothing was thrown";
  return {};
}

}  // namespace v3d::test
