#include <algorithm>
#include <climits>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <vector>

#include "base/core/error.h"
#include "base/core/text.h"
#include "base/io/file.h"
#include "gltf/gltf_file.h"

namespace v3d {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr int kMaxLevels = 64;
constexpr int64_t kMaxValues = 4'000'000;
constexpr int kNone = -1;

[[noreturn]] void fail(const fs::path& file, const std::string& what) {
  throw InputError(file.string() + ": " + what);
}

/// Parses JSON and checks its limits while parsing, because a value of one byte needs a hundred
/// bytes of memory.
json parse_bounded(std::string_view text, const fs::path& file) {
  int64_t values = 0;
  const auto on_value = [&](int level, json::parse_event_t, const json&) {
    if (level > kMaxLevels) fail(file, "expected at most 64 levels of JSON");
    if (++values > kMaxValues) fail(file, "expected at most 4 million values of JSON");
    return true;
  };
  json parsed = json::parse(text.begin(), text.end(), on_value, false);
  if (!parsed.is_object()) fail(file, "is no glTF 2.0: expected a JSON object");
  return parsed;
}

int hex_digit(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  return kNone;
}

/// `uri` without percent-encoding; empty where the encoding is wrong.
std::string decoded(const std::string& uri) {
  std::string text;
  for (size_t i = 0; i < uri.size(); ++i) {
    if (uri[i] != '%') {
      text += uri[i];
      continue;
    }
    const int high = i + 2 < uri.size() ? hex_digit(uri[i + 1]) : kNone;
    const int low = i + 2 < uri.size() ? hex_digit(uri[i + 2]) : kNone;
    if (high == kNone || low == kNone) return "";
    text += static_cast<char>(16 * high + low);
    i += 2;
  }
  return text;
}

/// Whether `path` is relative and has no "..". A colon would end the scheme of a URI.
bool is_below(const std::string& path) {
  constexpr std::string_view kForbidden(":\\?#\0", 5);
  if (path.empty() || path.front() == '/') return false;
  if (path.find_first_of(kForbidden) != std::string::npos) return false;
  const fs::path parts(path);
  return std::ranges::none_of(parts, [](const fs::path& part) { return part == ".."; });
}

class Check {
 public:
  Check(std::string_view text, const fs::path& file)
      : file_(file), gltf_(parse_bounded(text, file)) {}

  void run() {
    check_extensions();
    check_uris("buffers");
    check_uris("images");
    check_views();
    find_parents();
    check_depth();
    check_scenes();
  }

 private:
  [[noreturn]] void fail_at(const std::string& where, const std::string& what) const {
    fail(file_, where + ": " + what);
  }

  static std::string at(const std::string& list, size_t n) {
    return list + "[" + std::to_string(n) + "]";
  }

  /// The objects of a list; none where the file has no such list.
  std::vector<const json*> objects(const std::string& list) const {
    std::vector<const json*> found;
    const auto values = gltf_.find(list);
    if (values == gltf_.end()) return found;
    if (!values->is_array()) fail_at(list, "expected a list");
    for (const json& value : *values) {
      if (!value.is_object()) fail_at(at(list, found.size()), "expected an object");
      found.push_back(&value);
    }
    return found;
  }

  /// A whole number, 0 or more; `missing` where the object has no such key.
  uint64_t number(const json& object, const char* key, uint64_t missing,
                  const std::string& where) const {
    const auto value = object.find(key);
    if (value == object.end()) return missing;
    if (!value->is_number_unsigned()) {
      fail_at(where + "." + key, "expected a whole number, 0 or more");
    }
    return value->get<uint64_t>();
  }

  /// A list of numbers of existing nodes.
  std::vector<size_t> node_list(const json& object, const char* key,
                                const std::string& where) const {
    std::vector<size_t> nodes;
    const auto values = object.find(key);
    if (values == object.end()) return nodes;
    if (!values->is_array()) fail_at(where, "expected a list");
    for (const json& value : *values) {
      const bool is_node = value.is_number_unsigned() && value.get<uint64_t>() < parents_.size();
      if (!is_node) fail_at(where, "names node " + value.dump() + ", which does not exist");
      nodes.push_back(value.get<size_t>());
    }
    return nodes;
  }

  /// Rejects required extensions other than of materials and textures, because they can change
  /// geometry.
  void check_extensions() const {
    const auto required = gltf_.find("extensionsRequired");
    if (required == gltf_.end() || !required->is_array()) return;
    for (const json& value : *required) {
      const std::string name = value.is_string() ? value.get<std::string>() : value.dump();
      if (name.starts_with("KHR_materials_") || name == "KHR_texture_transform") continue;
      fail(file_,
           "requires " + name + ", which is not read here: save it uncompressed, without " + name);
    }
  }

  void check_uris(const std::string& list) const {
    const auto all = objects(list);
    for (size_t n = 0; n < all.size(); ++n) {
      const auto uri = all[n]->find("uri");
      if (uri == all[n]->end()) continue;
      const std::string where = at(list, n) + ".uri";
      if (!uri->is_string()) fail_at(where, "expected a text");
      check_uri(uri->get_ref<const std::string&>(), where);
    }
  }

  void check_uri(const std::string& uri, const std::string& where) const {
    if (uri.starts_with("data:")) return;
    const std::string name = decoded(uri);
    const fs::path folder = file_.has_parent_path() ? file_.parent_path() : fs::path(".");
    if (!is_below(name)) fail_at(where, "expected the path of a file in the model's folder");
    const auto found = io::File::open(folder / name, io::OpenMode::kRead);
    if (!found) fail_at(where, found.error().message);
    if (!lies_within(folder / name, folder)) {
      fail_at(where, name + " is a link out of the model's folder: copy the file into the folder");
    }
  }

  void check_views() const {
    const auto buffers = objects("buffers"), views = objects("bufferViews");
    for (size_t n = 0; n < views.size(); ++n) {
      const std::string where = at("bufferViews", n);
      const uint64_t buffer = number(*views[n], "buffer", UINT64_MAX, where);
      if (buffer >= buffers.size())
        fail_at(where + ".buffer", "names a buffer that does not exist");
      const uint64_t whole = number(*buffers[buffer], "byteLength", 0, at("buffers", buffer));
      const uint64_t begin = number(*views[n], "byteOffset", 0, where);
      const uint64_t bytes = number(*views[n], "byteLength", 0, where);
      if (begin > whole || bytes > whole - begin || bytes > INT_MAX) {
        fail_at(where, "ends beyond its buffer of " + format_count(static_cast<int64_t>(whole)) +
                           " bytes");
      }
    }
  }

  void find_parents() {
    const auto nodes = objects("nodes");
    parents_.assign(nodes.size(), kNone);
    for (size_t n = 0; n < nodes.size(); ++n) {
      const std::string where = at("nodes", n) + ".children";
      for (const size_t child : node_list(*nodes[n], "children", where)) {
        if (parents_[child] != kNone) {
          fail_at(where, "names node " + std::to_string(child) + ", which is a child of " +
                             at("nodes", static_cast<size_t>(parents_[child])) +
                             " already; expected one parent at most");
        }
        parents_[child] = static_cast<int>(n);
      }
    }
  }

  void check_depth() const {
    for (size_t n = 0; n < parents_.size(); ++n) {
      int depth = 0;
      for (int p = parents_[n]; p != kNone; p = parents_[static_cast<size_t>(p)]) {
        if (p == static_cast<int>(n)) fail_at(at("nodes", n), "is its own ancestor");
        if (++depth > kMaxNodeDepth) {
          fail_at(at("nodes", n), "is nested too deeply; expected at most 64 levels");
        }
      }
    }
  }

  void check_scenes() const {
    const auto scenes = objects("scenes");
    for (size_t n = 0; n < scenes.size(); ++n) {
      const std::string where = at("scenes", n) + ".nodes";
      std::set<size_t> roots;
      for (const size_t root : node_list(*scenes[n], "nodes", where)) {
        const std::string name = "names node " + std::to_string(root);
        if (!roots.insert(root).second) fail_at(where, name + " twice; expected each once");
        if (parents_[root] == kNone) continue;
        fail_at(where, name + ", a child of " + at("nodes", static_cast<size_t>(parents_[root])) +
                           "; expected nodes without a parent");
      }
    }
  }

  const fs::path& file_;
  const json gltf_;
  std::vector<int> parents_;  ///< of every node: its parent's number, or kNone
};

}  // namespace

void check_gltf(std::string_view text, const fs::path& file) { Check(text, file).run(); }

bool lies_within(const fs::path& path, const fs::path& folder) {
  std::error_code error;
  const fs::path whole = fs::canonical(path, error);
  if (error) return false;
  const fs::path within = fs::canonical(folder, error);
  if (error) return false;
  const auto [rest, _] = std::mismatch(within.begin(), within.end(), whole.begin(), whole.end());
  return rest == within.end();
}

}  // namespace v3d
