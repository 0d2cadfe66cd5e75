// Listing of takes with their slates.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/core/error.h"
#include "base/core/time.h"
#include "base/io/file.h"
#include "take/take.h"

namespace v3d::take {

// slate.toml: the crew's notes about a take. People and tools write it after the recording. A take
// without this file has an empty slate.

enum class Mark : uint8_t { kNone, kCircled, kRejected };
/// "", "circled", "rejected"
std::string_view name(Mark mark);

struct Slate {
  std::string scene;
  std::string take;
  std::string note;
  Mark mark = Mark::kNone;

  /// All fields in one line without control characters: "scene 12, take 3, circled, the sword
  /// slips". Empty for an empty slate.
  std::string text() const;
  friend bool operator==(const Slate&, const Slate&) = default;
};

/// Reads slate.toml. Returns an empty slate when the file does not exist. Throws InputError with
/// file, line and field.
Slate load_slate(const std::filesystem::path& path);
Slate parse_slate(std::string_view text, const std::filesystem::path& path);
/// Writes slate.toml with io::replace_file().
[[nodiscard]] io::Status save_slate(const std::filesystem::path& path, const Slate& slate);

/// Reads the slate of a take, calls `change` with it, and writes it. Returns what was written.
///
/// A lock (flock) on the folder of the take excludes other calls meanwhile, also those of other
/// processes. Over NFS and on file systems without locks it excludes none. Throws InputError when
/// the slate cannot be read, std::runtime_error when it cannot be written.
Slate change_slate(const TakePaths& paths, const std::function<void(Slate&)>& change);

// Listing of the takes in a folder, as operators see it.

struct TakeListing {
  TakePaths paths;
  TakeInfo info;
  bool edited = false;                 ///< is_edited()
  bool whole = false;                  ///< the ledger reports the take as complete
  std::vector<TakeNode> absent_nodes;  ///< Ledger::absent_nodes
  /// Timecode of the first and the last pulse, by the sound of a node with LTC, otherwise of any
  /// node: "10:00:00:00 to 10:01:00:00"; empty: unknown.
  std::string timecode;
  bool examined = false;  ///< v3dctl verify has read the current files, with any result
  bool verified = false;  ///< `examined`, and all files matched the ledger
  int64_t bytes = 0;      ///< size of all files of the take
  /// Number of meshes, of an edited take that of its pulses; 0 without mesh.v3d; empty when it
  /// cannot be read.
  std::optional<int64_t> meshes;
  int64_t proxy_bytes = 0;  ///< size of proxy.v3d; 0 without
  std::string mesh_error;   ///< why mesh.v3d cannot be read, with its path; otherwise empty
  Slate slate;
  /// Why another file cannot be read, with its path; what it has is then missing here. Otherwise
  /// empty.
  std::string error;

  /// 0 where take.toml cannot be read.
  double seconds() const {
    return info.rate_hz > 0 ? static_cast<double>(info.pulses) / info.rate_hz : 0;
  }
  /// recording, edited, incomplete, recovered or complete
  std::string_view verdict() const;
};

/// Reads the listing of one take. Throws InputError when the folder is not a take, or one of its
/// files other than mesh.v3d cannot be read.
TakeListing read_take_listing(const TakePaths& paths);

/// The same for a folder that read_take_listing() rejects, too: with TakeListing::error and what
/// can be read of the take; without take.toml's name and time, with those of the folder and of the
/// file.
TakeListing read_listing_with_error(const TakePaths& paths);

/// The takes in `folder`, oldest first, each read with `read`. A folder with logs and no take.toml
/// is listed, too, with TakeListing::error. Throws InputError when `folder` is not a folder.
std::vector<TakeListing> find_all_takes(
    const std::filesystem::path& folder,
    const std::function<TakeListing(const TakePaths&)>& read = read_listing_with_error);

/// find_all_takes() without the takes that have an error. Calls `on_unreadable` for each of these.
std::vector<TakeListing> find_takes(const std::filesystem::path& folder,
                                    const std::function<void(const InputError&)>& on_unreadable);

// Listings of takes, read again only for takes that have changed.

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
