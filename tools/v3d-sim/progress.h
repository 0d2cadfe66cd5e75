// How far a long job is, on stderr: one line that renews itself on a terminal, a line every tenth
// elsewhere.
#pragma once

#include <cstdint>
#include <string>

namespace v3d::sim {

class Progress {
 public:
  Progress(std::string what, int64_t total);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;
  void done(int64_t count);

 private:
  const std::string what_;
  const int64_t total_;
  const bool terminal_;
  int64_t last_shown_ = -1;
};

}  // namespace v3d::sim
