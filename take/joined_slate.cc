#include "take/joined_slate.h"

#include <algorithm>
#include <string_view>

#include "base/core/error.h"
#include "base/core/text.h"

namespace v3d::take {
namespace {

std::string first_text(const std::vector<NodeSlate>& slates, std::string Slate::*field) {
  for (const auto& [node, slate] : slates) {
    if (!(slate.*field).empty()) return slate.*field;
  }
  return "";
}

Mark strongest_mark(const std::vector<NodeSlate>& slates) {
  for (const Mark mark : {Mark::kCircled, Mark::kRejected}) {
    const auto has_mark = [mark](const NodeSlate& slate) { return slate.second.mark == mark; };
    if (std::ranges::any_of(slates, has_mark)) return mark;
  }
  return Mark::kNone;
}

/// The fields of `slate` that are not in `merged`.
Slate difference(Slate slate, const Slate& merged) {
  if (slate.scene == merged.scene) slate.scene.clear();
  if (slate.take == merged.take) slate.take.clear();
  if (slate.note == merged.note) slate.note.clear();
  if (slate.mark == merged.mark) slate.mark = Mark::kNone;
  return slate;
}

/// True when `note` is `text`, or contains it between the separators of merged_slate().
bool has_part(const std::string& note, const std::string& text) {
  for (size_t at = note.find(text); at != std::string::npos; at = note.find(text, at + 1)) {
    const std::string_view before = std::string_view(note).substr(0, at);
    const std::string_view after = std::string_view(note).substr(at + text.size());
    const bool starts = before.empty() || before.ends_with(": ") || before.ends_with(", ") ||
                        before.ends_with("; ");
    const bool ends = after.empty() || after.starts_with(", ") || after.starts_with("; ");
    if (starts && ends) return true;
  }
  return false;
}

/// The slates with text.
std::vector<NodeSlate> readable_slates(const std::vector<TakePaths>& parts) {
  std::vector<NodeSlate> slates;
  for (const TakePaths& part : parts) {
    try {
      Slate slate = load_slate(part.slate());
      if (slate != Slate{}) slates.emplace_back(part.folder.filename(), std::move(slate));
    } catch (const InputError&) {  // slates_not_joined() reports it
    }
  }
  return slates;
}

bool have_same_text(const TakePaths& a, const TakePaths& b) {
  const auto text = io::read_file(a.slate(), kMaxTakeTextBytes);
  const auto other = io::read_file(b.slate(), kMaxTakeTextBytes);
  return text && other && *text == *other;
}

}  // namespace

Slate merged_slate(const std::vector<NodeSlate>& slates) {
  const Slate first{.scene = first_text(slates, &Slate::scene),
                    .take = first_text(slates, &Slate::take),
                    .note = first_text(slates, &Slate::note),
                    .mark = strongest_mark(slates)};
  Slate merged = first;
  for (const auto& [node, slate] : slates) {
    const std::string text = difference(slate, first).text();
    if (text.empty()) continue;
    merged.note += (merged.note.empty() ? "" : "; ") + node + ": " + text;
  }
  return merged;
}

std::string text_not_in(const Slate& copy, const Slate& slate) {
  const std::string note = printable(copy.note);
  const auto is_in_note = [&](const Slate& field) { return has_part(note, field.text()); };
  Slate rest = difference(slate, copy);
  if (is_in_note({.scene = rest.scene, .take = {}, .note = {}})) rest.scene.clear();
  if (is_in_note({.scene = {}, .take = rest.take, .note = {}})) rest.take.clear();
  if (is_in_note({.scene = {}, .take = {}, .note = rest.note})) rest.note.clear();
  if (has_part(note, std::string(name(rest.mark)))) rest.mark = Mark::kNone;
  return rest.text();
}

io::Status join_slates(const std::vector<TakePaths>& parts, const TakePaths& into) {
  const std::vector<NodeSlate> slates = readable_slates(parts);
  if (!slates.empty()) return save_slate(into.slate(), merged_slate(slates));
  for (const TakePaths& part : parts) {
    if (file_exists(part.slate())) return io::copy_file(part.slate(), into.slate());
  }
  return {};
}

std::vector<std::string> slates_not_joined(const std::vector<TakePaths>& parts,
                                           const TakePaths& whole) {
  std::vector<std::string> lines;
  for (const TakePaths& part : parts) {
    try {
      load_slate(part.slate());
    } catch (const InputError& error) {
      if (have_same_text(part, whole)) continue;
      lines.push_back((part.folder.filename() / part.slate().filename()).string() +
                      ": is not copied: " + error.what());
    }
  }
  return lines;
}

}  // namespace v3d::take
