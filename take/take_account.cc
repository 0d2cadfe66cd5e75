#include "take/take_account.h"

#include <algorithm>

#include "base/checksum.h"
#include "base/error.h"

namespace v3d {
namespace {

std::optional<Ledger> ledger_before(const TakePaths& paths) {
  try {
    return load_ledger(paths.ledger());
  } catch (const InputError&) {
    return std::nullopt;
  }
}

bool is_camera_log(const std::string& name, const TakeInfo& info) {
  return name.ends_with(".lcmlog") && std::ranges::any_of(info.cameras, [&](const auto& camera) {
           return name.starts_with(camera + ".");
         });
}

TakeFile entry_of_camera_log(const TakePaths& paths, const std::string& name,
                             const std::optional<Ledger>& before) {
  TakeFile file = stat_take_file(paths, name).value_or(TakeFile{.name = name, .checksum = {}});
  const TakeFile* const known = before ? before->file(name) : nullptr;
  if (known && known->bytes == file.bytes) file.checksum = known->checksum;
  return file;
}

TakeFile entry_of_text(const std::string& name, const std::string& text) {
  const std::span bytes(reinterpret_cast<const uint8_t*>(text.data()), text.size());
  return {.name = name,
          .bytes = static_cast<int64_t>(text.size()),
          .changed_ns = 0,
          .checksum = checksum({bytes})};
}

TakeFile entry_of_file(const TakePaths& paths, const std::string& name) {
  auto read = read_take_file(paths, name, ReadFrom::kPageCache);
  if (read) return *std::move(read);
  return stat_take_file(paths, name).value_or(TakeFile{.name = name, .checksum = {}});
}

}  // namespace

io::Status save_account(const TakePaths& paths, const TakeInfo& info, Ledger ledger) {
  const std::optional<Ledger> before = ledger_before(paths);
  const auto names = take_file_names(paths);
  if (!names) return tl::make_unexpected(names.error());
  const std::string text = take_info_text(info), info_name = paths.info().filename();
  std::erase_if(ledger.files, [&](const TakeFile& file) { return file.name == info_name; });
  for (const std::string& name : *names) {
    if (is_written_after_ledger(name) || ledger.file(name) || name == info_name) continue;
    ledger.files.push_back(is_camera_log(name, info) ? entry_of_camera_log(paths, name, before)
                                                     : entry_of_file(paths, name));
  }
  ledger.files.push_back(entry_of_text(info_name, text));
  for (TakeFile& file : ledger.files) file.changed_ns = 0;
  std::ranges::sort(ledger.files, {}, &TakeFile::name);
  const io::Status saved = save_ledger(paths.ledger(), ledger);
  return saved ? save_take_info(paths, info) : saved;
}

}  // namespace v3d
