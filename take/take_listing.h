// Listing of the takes in a folder, as operators see it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/core/error.h"
#include "take/slate.h"
#include "take/take.h"
#include "take/take_nodes.h"

namespace v3d {

struct TakeListing {
  TakePaths paths;
  TakeInfo info;
  bool whole = false;                  ///< the ledger reports the take as complete
  std::vector<TakeNode> absent_nodes;  ///< Ledger::absent_nodes
  bool examined = false;  ///< v3dctl verify has read the current files, with any result
  bool verified = false;  ///< `examined`, and all files matched the ledger
  int64_t bytes = 0;      ///< size of all files of the take
  /// Number of meshes; 0 without mesh.v3d; empty when it cannot be read.
  std::optional<int64_t> meshes;
  std::string mesh_error;  ///< why mesh.v3d cannot be read, with its path; otherwise empty
  Slate slate;

  double seconds() const { return static_cast<double>(info.pulses) / info.rate_hz; }
  /// recording, incomplete, recovered or complete
  std::string_view verdict() const;
};

/// Reads the listing of one take. Throws InputError when the folder is not a take, or one of its
/// files other than mesh.v3d cannot be read.
TakeListing read_take_listing(const TakePaths& paths);

/// The takes in `folder`, oldest first. Skips a take that cannot be read, and calls `on_unreadable`
/// with the error. Throws InputError when `folder` is not a folder.
std::vector<TakeListing> find_takes(const std::filesystem::path& folder,
                                    const std::function<void(const InputError&)>& on_unreadable);

}  // namespace v3d
