#include "base/name_list.h"

#include <algorithm>

namespace v3d {

std::string join_names(const std::vector<std::string>& names) {
  constexpr size_t kMaxNames = 24;
  std::string joined;
  for (size_t i = 0; i < std::min(names.size(), kMaxNames); ++i)
    joined += (i ? ", " : "") + names[i];
  if (names.size() > kMaxNames) joined += ", ...";
  return joined;
}

}  // namespace v3d
