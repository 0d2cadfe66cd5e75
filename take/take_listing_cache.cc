#include "take/take_listing_cache.h"

#include <sys/stat.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <optional>
#include <string>

#include "base/core/bytes.h"
#include "base/core/error.h"
#include "base/io/file.h"

namespace v3d::take {
namespace {

namespace fs = std::filesystem;

int64_t ns_of(const timespec& time) { return time.tv_sec * 1'000'000'000 + time.tv_nsec; }

/// The state of all files in a folder and its subfolders.
class FolderState {
 public:
  /// Throws InputError when a folder or the state of a file cannot be read.
  explicit FolderState(const fs::path& folder) { add_folder(folder); }

  /// Another one when a file was added, changed, replaced or removed.
  uint64_t stamp() const { return sum_.value(); }
  /// The last change of a file, its name or its attributes.
  RealtimeInstant changed() const { return from_ns<Realtime>(changed_ns_); }

 private:
  void add_folder(const fs::path& folder) {
    auto entries = io::list_folder(folder);
    if (!entries && entries.error().code == ENOENT) return;
    for (const fs::path& entry : io::value_or_throw(std::move(entries))) add_entry(entry);
  }

  void add_entry(const fs::path& entry) {
    struct stat state {};
    if (lstat(entry.c_str(), &state) != 0) {
      if (errno == ENOENT) return;
      throw InputError(errno_message("cannot read " + entry.string()));
    }
    add(entry, state);
    if (S_ISDIR(state.st_mode)) add_folder(entry);
  }

  void add(const fs::path& path, const struct stat& state) {
    const std::string name = path;
    const std::array<int64_t, 6> numbers{static_cast<int64_t>(state.st_dev),
                                         static_cast<int64_t>(state.st_ino),
                                         static_cast<int64_t>(state.st_mode),
                                         state.st_size,
                                         ns_of(state.st_mtim),
                                         ns_of(state.st_ctim)};
    // With the zero after the name, no two lists of names have the same bytes.
    sum_.add({reinterpret_cast<const uint8_t*>(name.c_str()), name.size() + 1});
    sum_.add({reinterpret_cast<const uint8_t*>(numbers.data()), sizeof numbers});
    changed_ns_ = std::max(changed_ns_, ns_of(state.st_ctim));
  }

  RunningChecksum sum_;
  int64_t changed_ns_ = 0;
};

/// Empty when the state cannot be read; reading the take then reports the cause.
std::optional<FolderState> state_of(const fs::path& folder) {
  try {
    return FolderState(folder);
  } catch (const InputError&) {
    return std::nullopt;
  }
}

}  // namespace

std::vector<TakeListing> TakeListingCache::find_all_takes(const fs::path& folder) {
  KnownTakes before = std::move(known_);
  known_.clear();
  return take::find_all_takes(folder, [&](const TakePaths& paths) { return read(paths, before); });
}

/// The state is from before the files are read: a change meanwhile gives another stamp next time.
TakeListing TakeListingCache::read(const TakePaths& paths, KnownTakes& before) {
  const auto state = state_of(paths.folder);
  const bool is_settled = state && now_() - state->changed() >= kSettled;
  const auto known = before.find(paths.folder);
  const bool is_unchanged = state && known != before.end() && known->second.stamp == state->stamp();
  TakeListing listing =
      is_unchanged ? std::move(known->second.listing) : read_listing_with_error(paths);
  if (is_settled && listing.error.empty() && listing.mesh_error.empty()) {
    known_[paths.folder] = {.stamp = state->stamp(), .listing = listing};
  }
  return listing;
}

}  // namespace v3d::take
