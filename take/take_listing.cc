#include "take/take_listing.h"

#include <sys/stat.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <optional>
#include <string>
#include <tuple>

#include "base/config/toml_file.h"
#include "base/core/bytes.h"
#include "base/core/error.h"
#include "base/core/text.h"
#include "base/io/file.h"
#include "base/io/shared_file.h"
#include "take/ledger/ledger.h"
#include "take/ledger/take_account.h"
#include "take/logs/mesh_file.h"

namespace v3d::take {
namespace {

namespace fs = std::filesystem;

/// Total size of the files in `folder` and its subfolders. Ignores what is removed meanwhile, such
/// as the shards of a reconstruction. Throws InputError when a folder cannot be read.
int64_t bytes_in(const fs::path& folder) {
  int64_t bytes = 0;
  auto entries = io::list_folder(folder);
  if (!entries && entries.error().code == ENOENT) return 0;
  for (const fs::path& entry : io::value_or_throw(std::move(entries))) {
    struct stat status {};
    if (lstat(entry.c_str(), &status) != 0) {
      if (errno == ENOENT) continue;
      throw InputError(errno_message("cannot read " + entry.string()));
    }
    if (S_ISREG(status.st_mode)) bytes += status.st_size;
    if (S_ISDIR(status.st_mode)) bytes += bytes_in(entry);
  }
  return bytes;
}

/// Size of a file; 0 when it is absent.
int64_t bytes_of(const fs::path& file) {
  struct stat status {};
  return lstat(file.c_str(), &status) == 0 && S_ISREG(status.st_mode) ? status.st_size : 0;
}

void count_meshes(TakeListing& take) {
  if (take.edited) {
    take.meshes = take.info.pulses;
    return;
  }
  const fs::path mesh = take.paths.mesh();
  try {
    take.meshes = file_exists(mesh) ? std::ssize(MeshFileReader(mesh).pulses()) : 0;
  } catch (const InputError& error) {
    take.mesh_error = error.what();
  }
}

}  // namespace

std::string_view TakeListing::verdict() const {
  if (info.state == TakeState::kRecording) return "recording";
  if (edited) return "edited";
  if (!whole) return "incomplete";
  return info.state == TakeState::kRecovered ? "recovered" : "complete";
}

namespace {

/// The name of a take whose take.toml cannot be read, and when that was changed last.
void name_by_files(TakeListing& take) {
  take.info.name = take.paths.folder.filename();
  take.info.state = TakeState::kComplete;  // not shown as a recording
  struct stat status {};
  if (stat(take.paths.info().c_str(), &status) != 0) return;
  take.info.started =
      from_ns<Realtime>(status.st_mtim.tv_sec * 1'000'000'000 + status.st_mtim.tv_nsec);
}

void read_ledger(TakeListing& take) {
  if (!file_exists(take.paths.ledger())) return;
  const Ledger ledger = load_ledger(take.paths.ledger());
  take.whole = ledger.complete();
  take.absent_nodes = ledger.absent_nodes;
  take.timecode = timecode_text(ledger.sounds);
}

void read_verification(TakeListing& take) {
  const auto verified = load_verified(take.paths);
  take.examined = verified.has_value();
  take.verified = verified && verified->agrees;
}

}  // namespace

/// Reads each part of which the files can be read.
TakeListing read_listing_with_error(const TakePaths& paths) {
  TakeListing take;
  take.paths = paths;
  const auto try_to = [&](const auto& part) {
    try {
      part();
      return true;
    } catch (const InputError& error) {
      if (take.error.empty()) take.error = error.what();
      return false;
    }
  };
  const bool is_known = try_to([&] { take.info = load_take_info(paths); });
  if (!is_known) name_by_files(take);
  if (is_known) try_to([&] { read_ledger(take); });
  try_to([&] { take.edited = is_edited(paths); });
  try_to([&] { count_meshes(take); });
  take.proxy_bytes = bytes_of(paths.proxy());
  try_to([&] { read_verification(take); });
  try_to([&] { take.bytes = bytes_in(paths.folder); });
  try_to([&] { take.slate = load_slate(paths.slate()); });
  return take;
}

TakeListing read_take_listing(const TakePaths& paths) {
  TakeListing take = read_listing_with_error(paths);
  if (!take.error.empty()) throw InputError(take.error);
  return take;
}

std::vector<TakeListing> find_all_takes(const fs::path& folder,
                                        const std::function<TakeListing(const TakePaths&)>& read) {
  if (io::value_or_throw(io::type_of(folder)) != fs::file_type::directory)
    throw InputError(folder.string() + ": is not a folder; expected a folder of takes");
  std::vector<TakeListing> takes;
  for (const fs::path& entry : io::value_or_throw(list_take_folders(folder))) {
    const TakePaths paths{entry};
    try {
      if (file_exists(paths.info())) {
        takes.push_back(read(paths));
      } else if (io::value_or_throw(holds_logs(entry))) {
        throw InputError(entry.string() + ": " + missing_info_text(entry));
      }
    } catch (const InputError& error) {
      takes.emplace_back().paths = paths;
      takes.back().error = error.what();
      name_by_files(takes.back());
    }
  }
  std::sort(takes.begin(), takes.end(), [](const TakeListing& a, const TakeListing& b) {
    return std::tie(a.info.started, a.info.name) < std::tie(b.info.started, b.info.name);
  });
  return takes;
}

std::vector<TakeListing> find_takes(const fs::path& folder,
                                    const std::function<void(const InputError&)>& on_unreadable) {
  std::vector<TakeListing> takes = find_all_takes(folder);
  std::erase_if(takes, [&](const TakeListing& take) {
    if (take.error.empty()) return false;
    on_unreadable(InputError(take.error));
    return true;
  });
  return takes;
}

namespace {

Mark read_mark(const TomlTable& table) {
  const std::string text = table.text_or("mark", "");
  for (const Mark mark : {Mark::kNone, Mark::kCircled, Mark::kRejected}) {
    if (text == name(mark)) return mark;
  }
  table.fail("mark", "expected \"circled\", \"rejected\" or \"\"");
}

}  // namespace

std::string_view name(Mark mark) {
  switch (mark) {
    case Mark::kNone:
      return "";
    case Mark::kCircled:
      return "circled";
    case Mark::kRejected:
      return "rejected";
  }
  return "";
}

std::string Slate::text() const {
  std::string line;
  const auto add = [&](std::string_view before, std::string_view value) {
    if (value.empty()) return;
    line += line.empty() ? "" : ", ";
    line.append(before).append(value);
  };
  add("scene ", scene);
  add("take ", take);
  add("", name(mark));
  add("", note);
  return printable(line);
}

Slate load_slate(const std::filesystem::path& path) {
  if (!file_exists(path)) return {};
  return parse_slate(read_take_text(path), path);
}

Slate parse_slate(std::string_view text, const std::filesystem::path& path) {
  const TomlTable table = TomlTable::parse(text, path);
  Slate slate;
  slate.scene = table.text_or("scene", "");
  slate.take = table.text_or("take", "");
  slate.note = table.text_or("note", "");
  slate.mark = read_mark(table);
  table.reject_unknown_fields();
  return slate;
}

io::Status save_slate(const std::filesystem::path& path, const Slate& slate) {
  TomlWriter file;
  file.text("scene", slate.scene)
      .text("take", slate.take)
      .text("note", slate.note)
      .text("mark", name(slate.mark));
  return io::replace_file(path, file.written());
}

Slate change_slate(const TakePaths& paths, const std::function<void(Slate&)>& change) {
  // Without a lock, a change of two people within a millisecond may lose one of both.
  const auto lock = io::lock_folder(paths.folder);
  Slate slate = load_slate(paths.slate());
  change(slate);
  io::throw_if_failed(save_slate(paths.slate(), slate));
  return slate;
}

namespace {

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
