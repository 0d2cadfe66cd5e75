#include "v3dctl/takes/node_takes.h"

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <iterator>
#include <sstream>
#include <string_view>
#include <system_error>
#include <vector>

#include "base/core/error.h"
#include "base/core/text.h"
#include "base/core/time.h"
#include "base/io/file.h"
#include "base/io/unique_fd.h"
#include "common/console.h"
#include "take/joined_slate.h"
#include "take/logs/log_files.h"
#include "take/take_files.h"
#include "v3dctl/reconstruct/pending_mesh_file.h"

namespace v3d::ctl {

std::optional<ListedEntry> parse_entry(const std::string& line) {
  size_t end = 0;
  for (int column = 0; column < 4; ++column) {  // permissions, bytes, date, time
    end = line.find(' ', line.find_first_not_of(' ', end));
    if (end == std::string::npos) return std::nullopt;
  }
  return ListedEntry{line.front(), line.substr(end + 1)};
}

std::vector<std::string> absent_files(const std::string& itemized) {
  constexpr std::string_view kMark = "*deleting ";
  std::vector<std::string> files;
  std::istringstream lines(itemized);
  for (std::string line; std::getline(lines, line);) {
    if (!line.starts_with(kMark)) continue;
    std::string name = line.substr(line.find_first_not_of(' ', kMark.size()));
    const bool is_of_take = take::is_part_of_take(name) || take::is_written_after_ledger(name);
    const bool is_folder = name.ends_with('/');
    if (is_of_take && !is_folder && !io::is_temporary(name)) files.push_back(std::move(name));
  }
  return files;
}

int64_t total_bytes(const std::string& output) {
  constexpr std::string_view kLabel = "Total file size: ";
  const size_t found = output.find(kLabel);
  int64_t bytes = 0;
  if (found == std::string::npos) return bytes;
  for (const char c : std::string_view(output).substr(found + kLabel.size())) {
    if (c == ' ') break;
    if (c >= '0' && c <= '9') bytes = bytes * 10 + (c - '0');
  }
  return bytes;
}

namespace {

namespace fs = std::filesystem;

/// Adds an entry of the folder of takes to `found`.
void add_entry(const ListedEntry& entry, NodeTakes& found) {
  const std::string take = entry.path.parent_path(), file = entry.path.filename();
  if (take.empty() && entry.type == 'l' && is_file_name(file)) found.broken_links.insert(file);
  if (take.empty() || take.starts_with('.') || take.find('/') != std::string::npos) return;
  const bool is_log = entry.path.extension() == ".lcmlog";
  if (file != "take.toml" && file != "mesh.v3d" && !is_log) return;
  if (!is_file_name(take)) {
    found.odd_names.insert(take);
    return;
  }
  found.takes.insert(take);
  if (is_log) found.with_logs.insert(take);
  if (file == "take.toml") found.recorded.insert(take);
}

bool are_of_one_minute(RealtimeInstant a, RealtimeInstant b) {
  constexpr int64_t kMinuteNs = 60'000'000'000;
  return std::abs(to_ns(a) - to_ns(b)) < kMinuteNs;
}

/// Has the copy a log of a camera of the part, with the same content? Empty: no log is in both
/// ledgers with a checksum. Logs without a byte say nothing.
std::optional<bool> has_log_of(const TakeSummary& part, const TakeSummary& copy) {
  if (!part.ledger || !copy.ledger) return std::nullopt;
  std::optional<bool> found;
  for (const std::string& camera : part.info.cameras) {
    const std::string name = take::TakePaths{}.frames(camera);
    const take::TakeFile* recorded = part.ledger->file(name);
    const take::TakeFile* copied = copy.ledger->file(name);
    if (!recorded || recorded->bytes == 0 || !recorded->checksum) continue;
    if (!copied || !copied->checksum) continue;
    if (*copied->checksum == *recorded->checksum) return true;
    found = false;
  }
  return found;
}

bool are_of_one_take(const TakeSummary& part, const TakeSummary& copy) {
  if (part.info.started == copy.info.started) return true;
  return has_log_of(part, copy).value_or(are_of_one_minute(part.info.started, copy.info.started));
}

/// True for a segment of a camera's log, and for a sound file. The pulse log of a copy may be that
/// of another node.
bool is_of_recording(const std::string& file, const take::TakeInfo& part) {
  const bool is_sound = fs::path(file).parent_path() == take::TakePaths{}.sound();
  return is_sound || std::ranges::any_of(part.cameras, [&](const std::string& camera) {
           return take::is_of_log(file, take::TakePaths{}.frames(camera));
         });
}

/// What the ledger of the part has more than that of the copy: files, bytes, frames and pulses that
/// the node recorded, or found in a recovery, after it was copied.
std::vector<std::string> newer_in(const TakeSummary& part, const TakeSummary& copy) {
  std::vector<std::string> newer;
  if (!part.ledger || !copy.ledger) return newer;
  for (const take::TakeFile& file : part.ledger->files) {
    if (!is_of_recording(file.name, part.info)) continue;
    const take::TakeFile* copied = copy.ledger->file(file.name);
    // Ledgers of early versions list no files.
    if (!copied && !copy.ledger->files.empty()) newer.push_back(file.name);
    if (copied && copied->bytes < file.bytes) newer.push_back("bytes of " + file.name);
  }
  for (const take::CameraLedger& camera : part.ledger->cameras) {
    const auto& cameras = copy.ledger->cameras;
    const auto copied = std::ranges::find(cameras, camera.name, &take::CameraLedger::name);
    if (copied == cameras.end() || copied->written >= camera.written) continue;
    newer.push_back("frames of " + camera.name);
  }
  if (copy.ledger->commanded < part.ledger->commanded) newer.emplace_back("pulses");
  return newer;
}

std::string time_text(const take::TakeInfo& info) {
  return local_time(info.started, "%Y-%m-%d %H:%M:%S");
}

}  // namespace

NodeTakes list_node_takes(const Rsync& rsync, const NodeFolder& source, const fs::path& probe) {
  // The first pattern has no slash at its end: rsync omits without a message what it cannot
  // examine and what is excluded as a file.
  const ProcessResult listed =
      rsync.run({"--recursive", "--copy-dirlinks", "--list-only", "--include=/*",
                 "--include=/*/take.toml", "--include=/*/mesh.v3d", "--include=/*/*.lcmlog",
                 "--include=/" + probe.string(), "--exclude=*"},
                {source.place + "/"}, Output::kCapture);
  if (listed.status != 0) {
    throw InputError("cannot list the takes of " + source.node + " at " + source.place +
                     " (rsync ended with status " + std::to_string(listed.status) +
                     "); to skip the node, name the others with --from");
  }
  NodeTakes found;
  std::istringstream lines(listed.output);
  for (std::string line; std::getline(lines, line);) {
    const std::optional<ListedEntry> entry = parse_entry(line);
    if (!entry) continue;
    if (entry->path == probe) found.has_probe = true;
    add_entry(*entry, found);
  }
  return found;
}

TakeSummary read_summary(const take::TakePaths& paths) {
  TakeSummary summary{.info = load_take_info(paths), .ledger = {}};
  try {
    summary.ledger = take::load_ledger(paths.ledger());
  } catch (const InputError&) {  // missing, damaged, or of another version
  }
  return summary;
}

void fetch_summaries(const Rsync& rsync, const NodeFolder& source,
                     const std::set<std::string>& takes, const fs::path& into) {
  constexpr int kSomeFilesFailed = 23, kSomeFilesVanished = 24;
  std::vector<std::string> options = {"--recursive", "--copy-dirlinks"};
  for (const std::string& take : takes) {
    for (const char* end : {"", "/take.toml", "/ledger.toml", "/slate.toml"}) {
      options.push_back("--include=/" + take + end);
    }
  }
  options.emplace_back("--exclude=*");
  const int status =
      rsync.run(options, {source.place + "/", into.string() + "/"}, Output::kShow).status;
  if (status == 0 || status == kSomeFilesFailed || status == kSomeFilesVanished) return;
  throw InputError("cannot read the takes of " + source.node + " at " + source.place +
                   " (rsync ended with status " + std::to_string(status) +
                   "); to skip the node, name the others with --from");
}

bool has_bytes_of(const Rsync& rsync, const NodeFolder& source, const std::string& take,
                  const fs::path& copy, std::vector<std::string> options) {
  options.insert(options.end(), {"--recursive", "--checksum", "--dry-run", "--itemize-changes"});
  const ProcessResult compared =
      rsync.run(options, {source.place + "/" + take + "/", copy.string() + "/"}, Output::kCapture);
  return compared.status == 0 && compared.output.find(">f") == std::string::npos;
}

std::string slate_note(const take::TakePaths& part, const std::string& node,
                       const take::TakePaths& copy) {
  const std::string file = node + "/" + part.slate().filename().string();
  try {
    const std::string text =
        take::text_not_in(take::load_slate(copy.slate()), take::load_slate(part.slate()));
    if (text.empty()) return "";
    return file + ": has \"" + text +
           "\", which the copy lacks; v3dctl takes slate writes it there";
  } catch (const InputError& error) {
    return file + ": cannot be compared with that of the copy: " + error.what();
  }
}

std::string difference_from_copy(const TakeSummary& part, const std::string& node,
                                 const TakeSummary& copy, const fs::path& place) {
  if (!are_of_one_take(part, copy)) {
    return place.string() + ": is another take of this name, of " + time_text(copy.info) +
           "; that of " + node + " is of " + time_text(part.info) +
           ": collect it into another folder (--to)";
  }
  if (part.info.state == take::TakeState::kRecording) {
    return place.string() + ": is a copy from before " + node + " continued the take, which it " +
           "records, or stopped and has not restarted since";
  }
  std::vector<std::string> absent;
  std::ranges::copy_if(part.info.cameras, std::back_inserter(absent), [&](const auto& camera) {
    return std::ranges::find(copy.info.cameras, camera) == copy.info.cameras.end();
  });
  const std::string advice = "; move it to another folder, and repeat the command";
  if (!absent.empty()) {
    return place.string() + ": lacks " + join_names(absent) + " of " + node + advice;
  }
  const std::vector<std::string> newer = newer_in(part, copy);
  if (newer.empty()) return "";
  return place.string() + ": is a copy from before " + node +
         " continued or recovered the take: lacks " + join_names(newer) + advice;
}

namespace {

/// The regular files in a folder and its folders.
std::vector<fs::path> files_in(const fs::path& folder) {
  std::vector<fs::path> files;
  for (const fs::path& entry : io::value_or_throw(io::list_folder(folder))) {
    const fs::file_type type = io::value_or_throw(io::entry_type_of(entry));
    if (type == fs::file_type::regular) files.push_back(entry);
    if (type != fs::file_type::directory) continue;
    std::ranges::move(files_in(entry), std::back_inserter(files));
  }
  return files;
}

}  // namespace

take::TakeLock StagingFolder::lock(const std::string& take) const {
  constexpr int kMaxAttempts = 10;
  for (int attempt = 1;; ++attempt) {
    io::throw_if_failed(io::create_folders(folder_));
    auto lock = take::TakeLock::acquire({folder_}, take);
    if (lock) return *std::move(lock);
    // Another process has removed the empty folder.
    if (lock.error().code != ENOENT || attempt == kMaxAttempts) io::throw_input_error(lock.error());
  }
}

void StagingFolder::remove_if_empty() const {
  std::error_code not_empty;
  fs::remove(folder_, not_empty);
}

void reject_other_take(const take::TakeInfo& of_node, const take::TakePaths& part,
                       const NodeFolder& source) {
  std::optional<take::TakeInfo> copied;
  try {
    if (file_exists(part.info())) copied = load_take_info(part);
  } catch (const InputError&) {
    return;  // copied in part
  }
  if (!copied || copied->started == of_node.started) return;
  throw InputError(part.folder.string() + ": is of an earlier take of this name on " + source.node +
                   "; move " + part.folder.parent_path().string() +
                   " out of the folder, and repeat the command");
}

void remove_copies(const fs::path& folder) {
  const std::error_code error =
      io::uninterrupted_code([&](std::error_code& code) { fs::remove_all(folder, code); });
  if (error) throw fs::filesystem_error("cannot remove", folder, error);
}

void remove_shared_names(const fs::path& part) {
  for (const fs::path& file : files_in(part)) {
    if (fs::hard_link_count(file) > 1) fs::remove(file);
  }
}

bool has_hard_links(const fs::path& folder) {
  const fs::path file = folder / ".probe", second = folder / ".probe-2";
  replace_file(file, "");
  fs::remove(second);  // of a run that was killed
  std::error_code error;
  fs::create_hard_link(file, second, error);
  fs::remove(file);
  fs::remove(second);
  return !error;
}

int64_t bytes_in(const fs::path& folder) {
  int64_t bytes = 0;
  for (const fs::path& file : files_in(folder)) bytes += static_cast<int64_t>(fs::file_size(file));
  return bytes;
}

RunFolder::RunFolder(const fs::path& to)
    : name_(fs::path(StagingFolder::kName) / (".run-" + process_suffix())), path_(to / name_) {
  io::throw_if_failed(io::create_folders(path_));
}

RunFolder::~RunFolder() {
  std::error_code ignored;  // a remaining folder has no effect
  fs::remove_all(path_, ignored);
  fs::remove(path_.parent_path(), ignored);
}

}  // namespace v3d::ctl
