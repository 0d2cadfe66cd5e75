// Listings of takes, read again only for takes that have changed.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <utility>
#include <vector>

#include "base/core/time.h"
#include "take/take_listing.h"

namespace v3d::take {

/// find_all_takes() for programs that repeat it, such as a web server.
///
/// A call reads the files of a take only when one of them has changed since the last call. It gets
/// the state of each file (lstat), which reads no data. A take is read each time while it has an
/// error, whose cause may lie outside its files, and until kSettled after its last change, because
/// two changes within a tick of the file system's clock may have the same time. One thread at a
/// time.
class TakeListingCache {
 public:
  /// Longer than the resolution of times in a file system: 2 s in FAT.
  static constexpr Duration kSettled = std::chrono::seconds(3);
  using Now = std::function<RealtimeInstant()>;

  explicit TakeListingCache(Now now = Realtime::now) : now_(std::move(now)) {}

  /// The result of take::find_all_takes(). Throws what that throws.
  std::vector<TakeListing> find_all_takes(const std::filesystem::path& folder);

 private:
  struct Known {
    uint64_t stamp = 0;
    TakeListing listing;
  };
  using KnownTakes = std::map<std::filesystem::path, Known>;
  TakeListing read(const TakePaths& paths, KnownTakes& before);

  const Now now_;
  KnownTakes known_;  ///< those of the last call that may be used by the next one, by folder
};

}  // namespace v3d::take
