#include "v3dctl/reconstruct/left_out.h"

#include <algorithm>

#include "base/error.h"
#include "base/name_list.h"

namespace v3d::ctl {

std::vector<std::string> cameras_without(const TakeInfo& info,
                                         const std::vector<std::string>& left_out) {
  for (const std::string& name : left_out) {
    if (std::ranges::find(info.cameras, name) == info.cameras.end()) {
      throw InputError("--leave-out " + name + ": the take has no such camera; it has " +
                       join_names(info.cameras));
    }
  }
  std::vector<std::string> cameras;
  for (const std::string& name : info.cameras) {
    if (std::ranges::find(left_out, name) == left_out.end()) cameras.push_back(name);
  }
  if (cameras.empty()) throw InputError("--leave-out: leaves no camera of the take");
  return cameras;
}

}  // namespace v3d::ctl
