// The rights of a user without any, for tests of files that may not be read.
#pragma once

#include <unistd.h>

#include <cstdlib>

namespace v3d::test {

/// Until destruction, this process may read what every user may, also when it is that of root.
class WithoutRights {
 public:
  WithoutRights() : user_(geteuid()) {
    if (user_ == 0) is_set_ = seteuid(65534) == 0;
  }
  ~WithoutRights() {
    if (user_ == 0 && is_set_ && seteuid(user_) != 0) std::abort();
  }
  WithoutRights(const WithoutRights&) = delete;
  WithoutRights& operator=(const WithoutRights&) = delete;
  /// False when this system does not permit root to become another user.
  bool is_set() const { return is_set_; }

 private:
  uid_t user_;
  bool is_set_ = true;
};

}  // namespace v3d::test
