#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <variant>

#include "base/core/error.h"
#include "base/io/file.h"
#include "recon/editing/clip.h"
#include "v3dctl/edit/editor.h"
#include "v3dctl/json_field.h"

namespace v3d::ctl {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr int64_t kVersion = 1, kMaxFrame = 1'000'000, kMaxBlend = 1000;
constexpr size_t kMaxOperations = 1000;
constexpr int64_t kMaxFileBytes = 1 << 20;

EditRange read_range(const JsonField& field) {
  const std::vector<JsonField> ends = field.list();
  if (ends.size() != 2) field.fail("expected two frames, [first, end]");
  const EditRange range{ends[0].integer(0, kMaxFrame), ends[1].integer(0, kMaxFrame)};
  if (range.end <= range.first) field.fail("expected an end behind the first frame");
  return range;
}

OptionalRange read_range(const JsonField& operation, const std::string& key) {
  const auto field = operation.find(key);
  return field ? OptionalRange(read_range(*field)) : OptionalRange();
}

CutEdit read_cut(const JsonField& field) {
  field.expect_object({"do", "frames"});
  return {read_range(field.at("frames"))};
}

StretchEdit read_stretch(const JsonField& field) {
  field.expect_object({"do", "frames", "factor"});
  return {read_range(field, "frames"), field.at("factor").number(0.1, 10)};
}

MirrorEdit read_mirror(const JsonField& field) {
  field.expect_object({"do"});
  return {};
}

recon::Joint read_joint(const JsonField& field) {
  const std::string name = field.text();
  if (const auto joint = recon::find_joint(name)) return *joint;
  field.fail("there is no joint '" + name + "'; v3dctl skeleton lists the names");
}

BendEdit read_bend(const JsonField& field) {
  field.expect_object({"do", "frames", "joint", "degrees", "axis", "ramp"});
  BendEdit bend;
  bend.frames = read_range(field, "frames");
  bend.joint = read_joint(field.at("joint"));
  bend.degrees = field.at("degrees").number(-180, 180);
  if (const auto axis = field.find("axis")) {
    bend.axis = axis->vector();
    if (bend.axis.norm() < 1e-6) axis->fail("expected a direction other than [0, 0, 0]");
    bend.axis.normalize();
  }
  if (const auto ramp = field.find("ramp")) bend.ramp = ramp->integer(0, kMaxFrame);
  return bend;
}

SpliceEdit read_splice(const JsonField& field) {
  field.expect_object({"do", "take", "at", "from", "blend"});
  SpliceEdit splice{.take = field.at("take").path("edit"),
                    .at = read_range(field, "at"),
                    .from = read_range(field, "from")};
  if (const auto blend = field.find("blend")) splice.blend = blend->integer(1, kMaxBlend);
  return splice;
}

HoldFeetEdit read_hold_feet(const JsonField& field) {
  field.expect_object({"do", "fade"});
  HoldFeetEdit hold;
  if (const auto fade = field.find("fade")) hold.fade = fade->integer(0, kMaxBlend);
  return hold;
}

SwapEdit read_swap(const JsonField& field) {
  field.expect_object({"do", "take", "frame"});
  SwapEdit swap{.take = field.at("take").path("edit")};
  if (const auto frame = field.find("frame")) swap.frame = frame->integer(0, kMaxFrame);
  return swap;
}

Edit read_edit(const JsonField& field, const std::string& where) {
  const std::string kind = field.at("do").text();
  if (kind == "cut") return {where, read_cut(field)};
  if (kind == "stretch") return {where, read_stretch(field)};
  if (kind == "mirror") return {where, read_mirror(field)};
  if (kind == "bend") return {where, read_bend(field)};
  if (kind == "splice") return {where, read_splice(field)};
  if (kind == "hold_feet") return {where, read_hold_feet(field)};
  if (kind == "swap") return {where, read_swap(field)};
  field.at("do").fail("expected cut, stretch, mirror, bend, splice, hold_feet or swap");
}

}  // namespace

std::vector<Edit> parse_edits(std::string_view text, const fs::path& file) {
  const json parsed = json::parse(text, nullptr, false);
  if (parsed.is_discarded()) throw InputError(file.string() + ": is no JSON");
  const JsonField root(parsed, file, "");
  root.expect_object({"format", "version", "operations"});
  if (root.at("format").text() != "v3d-edit") root.at("format").fail("expected \"v3d-edit\"");
  root.at("version").integer(kVersion, kVersion);
  const std::vector<JsonField> operations = root.at("operations").list();
  if (operations.size() > kMaxOperations) {
    root.at("operations").fail("expected at most " + std::to_string(kMaxOperations));
  }
  std::vector<Edit> edits;
  for (const JsonField& operation : operations) {
    edits.push_back(
        read_edit(operation, file.string() + ": operations[" + std::to_string(edits.size()) + "]"));
  }
  return edits;
}

std::vector<Edit> load_edits(const fs::path& file) {
  return parse_edits(io::value_or_throw(io::read_file(file, kMaxFileBytes)), file);
}

const fs::path* take_of(const Edit& edit) {
  if (const auto* splice = std::get_if<SpliceEdit>(&edit.operation)) return &splice->take;
  if (const auto* swap = std::get_if<SwapEdit>(&edit.operation)) return &swap->take;
  return nullptr;
}

std::string edits_for_folder(const std::string& text, const fs::path& file,
                             const fs::path& folder) {
  const std::vector<Edit> edits = parse_edits(text, file);
  auto copy = nlohmann::ordered_json::parse(text);
  bool has_take = false;
  for (size_t n = 0; n < edits.size(); ++n) {
    const fs::path* take = take_of(edits[n]);
    if (take == nullptr) continue;
    has_take = true;
    copy["operations"][n]["take"] = fs::relative(*take, folder).string();
  }
  return has_take ? copy.dump(2) + "\n" : text;
}

}  // namespace v3d::ctl
