#include "take/ledger/take_account.h"

#include <algorithm>
#include <stdexcept>

#include "base/config/toml_file.h"
#include "base/core/bytes.h"
#include "base/core/error.h"
#include "base/core/text.h"
#include "base/io/file.h"

namespace v3d::take {
namespace {

std::optional<Ledger> previous_ledger(const TakePaths& paths) {
  try {
    return load_ledger(paths.ledger());
  } catch (const InputError&) {
    return std::nullopt;
  }
}

/// Entry of a camera log, with the checksum of the `previous` ledger when the length is the same.
/// Fails when the length cannot be read, because a ledger with a wrong length is worse than none.
io::Result<TakeFile> entry_of_camera_log(const TakePaths& paths, const std::string& name,
                                         const std::optional<Ledger>& previous) {
  auto file = stat_take_file(paths, name);
  if (!file) return file;
  const TakeFile* const known = previous ? previous->file(name) : nullptr;
  if (known && known->bytes == file->bytes) file->checksum = known->checksum;
  return file;
}

TakeFile entry_of_text(const std::string& name, const std::string& text) {
  const std::span bytes(reinterpret_cast<const uint8_t*>(text.data()), text.size());
  return {.name = name,
          .bytes = static_cast<int64_t>(text.size()),
          .changed_ns = 0,
          .checksum = checksum({bytes})};
}

/// Entry of another file. Adds a line to `unread` when it has no checksum; empty when its length
/// cannot be read either.
std::optional<TakeFile> entry_of_file(const TakePaths& paths, const std::string& name,
                                      std::vector<std::string>& unread,
                                      const ReadProgress& progress) {
  /// The pulse log of the longest take (kMaxPulses) has 2 GB. A sparse file can have any length.
  /// Only sound may be longer: it gets no checksum, because the read would delay the stop.
  constexpr int64_t kMaxBytes = int64_t{4} << 30;
  auto known = stat_take_file(paths, name);
  const bool is_sound = name.starts_with(TakePaths().sound().string() + "/");
  if (known && known->bytes > kMaxBytes && is_sound) return *std::move(known);
  if (known && known->bytes > kMaxBytes) {
    unread.push_back(name + ": has no checksum: it has " + format_count(known->bytes) +
                     " bytes; expected at most " + format_count(kMaxBytes));
    return *std::move(known);
  }
  auto read = read_take_file(paths, name, ReadFrom::kPageCache, progress);
  if (read) return *std::move(read);
  unread.push_back(read.error().message);
  return known ? std::optional(*std::move(known)) : std::nullopt;
}

/// Adds the files that `ledger` does not list yet. Returns one line for each file that could not be
/// read.
io::Result<std::vector<std::string>> add_files(const TakePaths& paths, const TakeInfo& info,
                                               Ledger& ledger, const ReadProgress& progress) {
  const std::optional<Ledger> previous = previous_ledger(paths);
  const auto names = take_file_names(paths);
  if (!names) return tl::make_unexpected(names.error());
  std::vector<std::string> unread;
  for (const std::string& name : *names) {
    if (is_written_after_ledger(name) || ledger.file(name)) continue;
    if (!is_camera_log(name, info)) {
      if (auto entry = entry_of_file(paths, name, unread, progress)) ledger.files.push_back(*entry);
      continue;
    }
    auto entry = entry_of_camera_log(paths, name, previous);
    if (!entry) return tl::make_unexpected(entry.error());
    ledger.files.push_back(*std::move(entry));
  }
  return unread;
}

}  // namespace

bool is_camera_log(const std::string& name, const TakeInfo& info) {
  return name.ends_with(".lcmlog") && std::ranges::any_of(info.cameras, [&](const auto& camera) {
           return name.starts_with(camera + ".");
         });
}

std::vector<std::string> files_without_checksum(const TakePaths& paths) {
  const TakeInfo info = load_take_info(paths);
  std::vector<std::string> names;
  for (const TakeFile& file : load_ledger(paths.ledger()).files) {
    if (!file.checksum && !is_camera_log(file.name, info)) names.push_back(file.name);
  }
  return names;
}

io::Result<std::vector<std::string>> save_account(const TakePaths& paths, const TakeInfo& info,
                                                  Ledger ledger, const ReadProgress& progress) {
  const std::string text = take_info_text(info), info_name = paths.info().filename();
  std::erase_if(ledger.files, [&](const TakeFile& file) { return file.name == info_name; });
  ledger.files.push_back(entry_of_text(info_name, text));  // take.toml is written below
  auto unread = add_files(paths, info, ledger, progress);
  if (!unread) return unread;
  for (TakeFile& file : ledger.files) file.changed_ns = 0;
  std::ranges::sort(ledger.files, {}, &TakeFile::name);
  io::Status saved = save_ledger(paths.ledger(), ledger);
  if (saved) saved = save_take_info(paths, info);
  if (!saved) return tl::make_unexpected(saved.error());
  return unread;
}

void save_account_or_throw(const TakePaths& paths, const TakeInfo& info, Ledger ledger) {
  const auto unread = save_account(paths, info, std::move(ledger));
  if (!unread) throw std::runtime_error(unread.error().message);
  if (!unread->empty()) throw std::runtime_error(unread->front());
}

namespace {

namespace fs = std::filesystem;

bool is_compared(const std::string& name) {
  const TakePaths paths;
  return name != paths.slate() && name != paths.verified();
}

/// True when every file still has its recorded length and modification time.
bool is_unchanged(const TakePaths& paths, const std::vector<TakeFile>& files) {
  const auto names = take_file_names(paths);
  if (!names) return false;
  size_t known = 0;
  for (const TakeFile& file : files) {
    if (!is_compared(file.name)) continue;
    ++known;
    const auto now = stat_take_file(paths, file.name);
    if (!now || now->bytes != file.bytes || now->changed_ns != file.changed_ns) return false;
  }
  return known == static_cast<size_t>(std::ranges::count_if(*names, is_compared));
}

/// Fails for an entry without a checksum: a record of an older version is not valid.
TakeFile read_entry(const TomlTable& table) {
  TakeFile file{.name = table.text("name"),
                .bytes = table.integer("bytes"),
                .changed_ns = table.integer("changed_ns"),
                .checksum = parse_checksum(table.text("xxh3"))};
  if (!file.checksum) table.fail("xxh3", "expected 16 hexadecimal digits");
  table.reject_unknown_fields();
  return file;
}

}  // namespace

io::Status save_verified(const TakePaths& paths, const Verification& verification,
                         const std::string& other_disagreement) {
  TomlWriter record;
  record.text("verdict", verification.ledger.verdict())
      .boolean("whole", verification.whole())
      .boolean("agrees", verification.disagreements.empty())
      .integer("at_ns", to_ns(Realtime::now()), "since 1970, CLOCK_REALTIME");
  if (!other_disagreement.empty()) record.text("other_disagreement", other_disagreement);
  for (const TakeFile& file : verification.files) {
    record.element("file")
        .text("name", file.name)
        .integer("bytes", file.bytes)
        .integer("changed_ns", file.changed_ns)
        .text("xxh3", checksum_text(file.checksum.value()));
  }
  return io::replace_file(paths.verified(), record.written());
}

std::optional<Verified> load_verified(const TakePaths& paths) {
  try {
    Verified verified = parse_verified(read_take_text(paths.verified()), paths.verified());
    if (!is_unchanged(paths, verified.files)) return std::nullopt;
    return verified;
  } catch (const InputError&) {
    return std::nullopt;
  }
}

Verified parse_verified(std::string_view text, const fs::path& path) {
  const TomlTable table = TomlTable::parse(text, path);
  Verified verified;
  verified.verdict = table.text("verdict");
  verified.whole = table.boolean_or("whole", false);
  verified.at = from_ns<Realtime>(table.integer("at_ns"));
  verified.agrees = table.boolean_or("agrees", false);
  verified.other_disagreement = table.text_or("other_disagreement", {});
  for (const TomlTable& file : table.tables("file")) verified.files.push_back(read_entry(file));
  table.reject_unknown_fields();
  return verified;
}

}  // namespace v3d::take
