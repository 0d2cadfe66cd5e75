// Takes as a crew sees them: what a folder of takes holds.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "base/core/error.h"
#include "take/slate.h"
#include "take/take.h"

namespace v3d {

struct TakeListing {
  TakePaths paths;
  TakeInfo info;
  bool whole = false;     ///< by its ledger
  bool examined = false;  ///< v3dctl verify read it, with whatever result, and nothing has changed
  bool verified = false;  ///< the same, and all its files agreed with its ledger
  int64_t bytes = 0;      ///< of all its files
  int64_t meshes = 0;
  Slate slate;

  double seconds() const { return static_cast<double>(info.pulses) / info.rate_hz; }
  /// recording, incomplete, recovered or complete
  std::string_view verdict() const;
};

/// Throws InputError when the folder is no take, or a file of it cannot be read.
TakeListing look_at_take(const TakePaths& paths);

/// The takes in a folder, oldest first. One that cannot be read is passed over, and `passed_over`
/// told why. Throws InputError when `folder` is none.
std::vector<TakeListing> find_takes(const std::filesystem::path& folder,
                                    const std::function<void(const InputError&)>& passed_over);

}  // namespace v3d
