#include "take/slate.h"

#include "base/config/toml_file.h"
#include "base/core/printable.h"
#include "base/io/file.h"
#include "base/io/whole_file.h"

namespace v3d {
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
  return parse_slate(read_take_file(path), path);
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
  return io::replace_file(path, "scene = " + toml_string(slate.scene) +      //
                                    "\ntake = " + toml_string(slate.take) +  //
                                    "\nnote = " + toml_string(slate.note) +  //
                                    "\nmark = " + toml_string(name(slate.mark)) + "\n");
}

}  // namespace v3d
