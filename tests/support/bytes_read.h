// What this process has read.
#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <fstream>
#include <string>

namespace v3d::test {

/// Bytes that this process has read by system calls so far.
inline int64_t bytes_read() {
  std::ifstream in("/proc/self/io");
  std::string key;
  int64_t bytes = 0;
  if (!(in >> key >> bytes) || key != "rchar:") ADD_FAILURE() << "no rchar in /proc/self/io";
  return bytes;
}

}  // namespace v3d::test
