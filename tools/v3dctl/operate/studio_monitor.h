// Hears the studio, and forgets who has fallen silent.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "base/studio_file.h"
#include "daemon/operator_client.h"
#include "v3dctl/operate/watch_table.h"

namespace v3d::ctl {

/// One thread.
class StudioWatcher {
 public:
  /// Throws InputError when the studio's network cannot be joined.
  explicit StudioWatcher(const Studio& studio);

  /// Takes what came since into view(), and waits for it a tenth of a second at most. Returns the
  /// events among it.
  std::vector<EventMessage> listen();
  const StudioView& view() const { return view_; }

 private:
  void forget_the_silent();

  OperatorClient client_;
  StudioView view_;
  std::map<std::string, MonotonicInstant> heard_;  ///< when, by node
};

}  // namespace v3d::ctl
