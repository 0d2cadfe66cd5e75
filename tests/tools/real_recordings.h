// Test fixture for real recordings outside the repository: in $V3D_DATA, else in ../shared/data
// beside it. Without this data, the tests are skipped.
#pragma once

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>

namespace v3d::test {

class RealRecordings : public testing::Test {
 protected:
  void SetUp() override {
    if (!std::filesystem::is_directory(data_)) {
      GTEST_SKIP() << "no real data: neither $V3D_DATA nor ../shared/data is a folder";
    }
  }

  const std::filesystem::path data_ = [] {
    const char* variable = std::getenv("V3D_DATA");
    return variable ? std::filesystem::path(variable)
                    : std::filesystem::path(V3D_SOURCE_DIR) / "../shared/data";
  }();
};

}  // namespace v3d::test
