#include "v3dctl/setup/node_settings.h"

#include <fmt/core.h>

#include <algorithm>
#include <cctype>
#include <initializer_list>
#include <set>
#include <sstream>
#include <stdexcept>
#include <system_error>

#include "base/core/error.h"
#include "base/core/text.h"
#include "base/io/file.h"
#include "base/io/shared_file.h"
#include "common/console.h"

namespace v3d::ctl {

io::UniqueFd lock_studio_files(const std::filesystem::path& studio_file) {
  std::error_code error;
  const std::filesystem::path target = std::filesystem::canonical(studio_file, error);
  if (error) throw InputError("cannot read " + studio_file.string() + ": " + error.message());
  const std::filesystem::path folder = target.parent_path();
  return io::value_or_throw(io::lock_folder(folder, [&] {
    note("v3dctl: waiting for another command that changes " + studio_file.string());
  }));
}

void require_member_list(const Studio& studio) {
  if (!studio.network.members.empty()) return;
  throw InputError(studio.path.string() +
                   ": [network] members is missing; name the file of the list there, and the "
                   "public key of the authority");
}

wire::PublicKey authority_of(const Studio& studio) {
  return wire::PublicKey::parse(studio.network.authority,
                                studio.path.string() + ": network.authority");
}

wire::MemberList load_member_list(const Studio& studio) {
  const std::filesystem::path& path = studio.network.members;
  const std::string text = io::value_or_throw(io::read_file(path, wire::kMaxMemberListBytes));
  return parse_member_list(text, path, authority_of(studio), studio.name);
}

ChangedMemberList changed_member_list(const Studio& studio,
                                      const std::filesystem::path& authority_file,
                                      const std::function<void(wire::MemberList&)>& change) {
  require_member_list(studio);
  const wire::SigningKey authority = wire::SigningKey::load(authority_file, wire::kAuthorityKey);
  if (authority.public_key() != authority_of(studio)) {
    throw InputError(authority_file.string() + ": its public key is " +
                     authority.public_key().text() + ", but " + studio.path.string() +
                     " has a different key for [network] authority");
  }
  const std::filesystem::path& path = studio.network.members;
  wire::MemberList list{.studio = studio.name, .serial = 0, .members = {}};
  if (std::filesystem::exists(path)) list = load_member_list(studio);
  change(list);
  ++list.serial;
  ChangedMemberList changed{.text = sign_member_list(list, authority), .serial = list.serial};
  parse_member_list(changed.text, path, authority.public_key(), studio.name);
  return changed;
}

namespace {

namespace fs = std::filesystem;

constexpr const char* kIdFile = "id";
const fs::path kSettingsFolder = "/etc/v3d";
const fs::path kDataFolder = "/var/lib/v3d";
constexpr uint64_t kMaxLoginKeysBytes = 1 << 20;

/// Number of these settings: 32 random hexadecimal digits.
std::string random_id() {
  return fmt::format("{:016x}{:016x}\n", wire::random_nonce(), wire::random_nonce());
}

std::vector<std::string> lines_of(std::string_view text) {
  std::vector<std::string> lines;
  std::istringstream in{std::string(text)};
  for (std::string line; std::getline(in, line);) lines.push_back(line);
  return lines;
}

/// Lines of the [[node]] with this name: its name, and its public key where it has one.
struct NodeLines {
  std::optional<size_t> name;
  std::optional<size_t> public_key;
};

/// The text behind these words, which may have spaces before each; empty unless the line starts so.
/// Lines of a studio file may have any length, which std::regex_match() does not allow: it uses
/// stack for each character.
std::optional<std::string_view> text_behind(std::string_view line,
                                            std::initializer_list<std::string_view> words) {
  for (const std::string_view word : words) {
    line.remove_prefix(std::min(line.find_first_not_of(" \t\r"), line.size()));
    if (!line.starts_with(word)) return std::nullopt;
    line.remove_prefix(word.size());
  }
  return line;
}

/// The text in quotes of a line `name = "cap01"`; empty for another line.
std::optional<std::string_view> name_in(std::string_view line) {
  constexpr std::string_view kQuotes = "\"'";
  const auto value = text_behind(line, {"name", "=", ""});  // "": skips spaces
  if (!value || value->empty() || kQuotes.find(value->front()) == std::string_view::npos)
    return std::nullopt;
  const size_t end = value->find_first_of(kQuotes, 1);
  if (end == std::string_view::npos) return std::nullopt;
  return value->substr(1, end - 1);
}

NodeLines find_node(const std::vector<std::string>& lines, std::string_view node) {
  NodeLines found;
  bool in_node = false;
  for (size_t i = 0; i < lines.size(); ++i) {
    if (text_behind(lines[i], {"["})) {
      if (found.name) break;
      in_node = text_behind(lines[i], {"[[", "node", "]]"}).has_value();
      found = {};
    } else if (in_node && name_in(lines[i]) == node) {
      found.name = i;
    } else if (in_node && text_behind(lines[i], {"public_key", "="})) {
      found.public_key = i;
    }
  }
  return found.name ? found : NodeLines{};
}

std::string join_lines(const std::vector<std::string>& lines) {
  std::string text;
  for (const std::string& line : lines) text += line + "\n";
  return text;
}

const StudioNode* node_of(const Studio& studio, std::string_view name) {
  const auto found = std::ranges::find(studio.nodes, name, &StudioNode::name);
  return found == studio.nodes.end() ? nullptr : &*found;
}

/// True for the files that this program and a PC write into a settings folder. An interrupted
/// command leaves temporary files.
bool is_settings_file(const fs::path& file) {
  static const std::set<std::string> kNames = {
      "hostname",     "role",        "studio.toml", "calib.toml",      "members.toml",
      "studio.key",   "signing.key", "pc",          "authorized_keys", "root_authorized_keys",
      "time_servers", "taken",       "report.txt",  "report.new"};
  return file.filename() == kIdFile || kNames.contains(file.filename()) ||
         file.extension() == ".network" || file.extension() == ".link" || io::is_temporary(file);
}

/// True for the keys of a settings folder.
bool is_secret(const fs::path& file) {
  return file.filename() == "studio.key" || file.filename() == "signing.key";
}

/// Fills a file with zeros. Its removal alone would leave its bytes on the stick.
void overwrite(const fs::path& path) {
  io::File file = io::value_or_throw(io::File::open(path, io::OpenMode::kWriteExisting));
  const std::vector<uint8_t> zeros(io::value_or_throw(file.size()));
  io::throw_if_failed(file.write(0, {zeros}));
  io::throw_if_failed(file.sync());
}

/// Removes an earlier settings folder, its `id` first, so that no PC takes a part of it. Its keys
/// are overwritten: a studio key stays valid. Throws InputError, and changes nothing, where the
/// folder has other files.
void remove_settings(const fs::path& folder) {
  for (const auto& entry : fs::directory_iterator(folder)) {
    if (entry.is_directory() || !is_settings_file(entry.path())) {
      throw InputError(entry.path().string() +
                       ": is no file of v3dctl node add; move it out of the folder");
    }
  }
  fs::remove(folder / kIdFile);
  io::throw_if_failed(io::sync_folder(folder));
  for (const auto& entry : fs::directory_iterator(folder)) {
    if (is_secret(entry.path())) overwrite(entry.path());
    fs::remove(entry.path());
  }
  fs::remove(folder);
}

/// True for the type of a public key of ssh, such as "ssh-ed25519".
bool is_key_type(std::string_view word) {
  constexpr std::string_view kLetters = "abcdefghijklmnopqrstuvwxyz0123456789@.-";
  for (const std::string_view start : {"ssh-", "ecdsa-", "sk-"}) {
    if (!word.starts_with(start) || word.size() == start.size()) continue;
    return word.find_first_not_of(kLetters) == std::string_view::npos;
  }
  return false;
}

/// True for an empty line, a comment, and a public key, also one after options. The line may have
/// any length.
bool is_login_line(const std::string& line) {
  std::istringstream in(line);
  std::string before, word;
  if (!(in >> before) || before.starts_with('#')) return true;
  while (in >> word) {
    const auto first = static_cast<unsigned char>(word.front());
    if (is_key_type(before) && (std::isalnum(first) || first == '+' || first == '/')) return true;
    before = word;
  }
  return false;
}

constexpr size_t kMaxServerName = 253;  // of a name in DNS

/// True for the characters of a name or of an address, of which the first is a letter or a digit.
bool is_server_name(std::string_view name) {
  constexpr std::string_view kLetters =
      "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789.:-";
  constexpr std::string_view kOther = ".:-";
  return !name.empty() && name.find_first_not_of(kLetters) == std::string_view::npos &&
         kOther.find(name.front()) == std::string_view::npos;
}

void require_path(const fs::path& path, const std::string& field, const fs::path& actual,
                  const std::string& right) {
  if (actual == kSettingsFolder / right) return;
  throw InputError(path.string() + ": " + field + " is " + actual.string() +
                   " on the appliance; expected \"" + right + "\"");
}

void require_data_path(const fs::path& path, const std::string& field, const fs::path& actual) {
  const fs::path inside = actual.lexically_normal().lexically_relative(kDataFolder);
  if (!inside.empty() && *inside.begin() != ".." && inside != ".") return;
  throw InputError(path.string() + ": " + field + " is " + actual.string() +
                   " on the appliance; expected a folder in " + kDataFolder.string());
}

/// Replaces the files of a settings folder that list the nodes of the studio.
void replace_lists(const fs::path& folder, const NodeSettings& settings) {
  for (const char* name : {"studio.toml", "members.toml"}) {
    const auto text = settings.files.find(name);
    if (text != settings.files.end()) replace_file(folder / name, text->second);
  }
}

}  // namespace

void require_host_name(const std::string& name) {
  constexpr size_t kMaxLength = 63;
  constexpr std::string_view kCharacters = "abcdefghijklmnopqrstuvwxyz0123456789-";
  const bool is_host_name = !name.empty() && name.size() <= kMaxLength &&
                            name.find_first_not_of(kCharacters) == std::string::npos &&
                            name.front() != '-' && name.back() != '-';
  if (is_host_name) return;
  throw InputError("node '" + name +
                   "': the name is also that of a host; use small letters, digits and '-', at most "
                   "63, e.g. cap07");
}

wire::Role role_of(const Studio& studio, std::string_view node) {
  return studio.reconstructs(node) ? wire::Role::kReconstruction : wire::Role::kCapture;
}

std::string with_node(std::string_view text, const fs::path& path, std::string_view node,
                      const std::string& public_key) {
  std::vector<std::string> lines = lines_of(text);
  const std::string field = "public_key = \"" + public_key + "\"";
  const bool is_listed = node_of(parse_studio(text, path), node) != nullptr;
  if (is_listed && public_key.empty()) return std::string(text);
  const NodeLines found = find_node(lines, node);
  if (!is_listed) {
    lines.insert(lines.end(), {"", "[[node]]", "name = \"" + std::string(node) + "\""});
    if (!public_key.empty()) lines.push_back(field);
  } else if (found.public_key) {
    lines[*found.public_key] = field;
  } else if (found.name) {
    lines.insert(lines.begin() + static_cast<std::ptrdiff_t>(*found.name) + 1, field);
  }
  const std::string changed = join_lines(lines);
  const Studio studio = parse_studio(changed, path);
  const StudioNode* const added = node_of(studio, node);
  if (added != nullptr && added->public_key == public_key) return changed;
  throw InputError(path.string() + ": cannot enter the key of " + std::string(node) +
                   " here; enter it by hand, under its [[node]]: " + field);
}

void require_appliance_paths(std::string_view text, const fs::path& path) {
  const Studio studio = parse_studio(text, kSettingsFolder / "studio.toml");
  require_path(path, "[network] key", studio.network.key, "studio.key");
  require_path(path, "[storage] calib", studio.storage.calib, "calib.toml");
  if (!studio.network.members.empty()) {
    require_path(path, "[network] members", studio.network.members, "members.toml");
  }
  if (!studio.storage.signing_key.empty()) {
    require_path(path, "[storage] signing_key", studio.storage.signing_key, "signing.key");
  }
  require_data_path(path, "[storage] takes", studio.storage.takes);
  require_data_path(path, "[storage] background", studio.storage.background);
}

std::string read_login_keys(const fs::path& path) {
  const std::string text = io::value_or_throw(io::read_file(path, kMaxLoginKeysBytes));
  for (const std::string& line : lines_of(text)) {
    if (is_login_line(line)) continue;
    throw InputError(path.string() +
                     ": a line is no public key of ssh; expected e.g. ~/.ssh/id_ed25519.pub");
  }
  return text;
}

std::string time_servers_text(const std::vector<std::string>& servers) {
  std::string text;
  for (const std::string& server : servers) {
    if (server.size() > kMaxServerName) {
      throw InputError("--time-server has " + format_count(std::ssize(server)) +
                       " characters; expected a name of at most " + format_count(kMaxServerName) +
                       " or an address");
    }
    if (!is_server_name(server)) {
      throw InputError("--time-server '" + server +
                       "': expected a name or an address, e.g. ntp.studio or 192.168.1.1");
    }
    text += server + "\n";
  }
  return text;
}

fs::path write_node_settings(const fs::path& stick, const NodeSettings& settings,
                             bool is_replaced) {
  if (!fs::is_directory(stick)) {
    throw InputError(stick.string() + ": is no folder; expected the mount point of the stick");
  }
  const fs::path folder = stick / "v3d" / settings.name;
  if (fs::exists(folder)) {
    if (fs::exists(folder / kIdFile) && !is_replaced) {
      throw InputError(folder.string() +
                       ": exists already; --replace writes new settings, with a new signing key");
    }
    remove_settings(folder);
  }
  fs::create_directories(folder);
  for (const auto& [name, text] : settings.files) replace_file(folder / name, text);
  settings.studio_key.save(folder / "studio.key", "");
  if (settings.signing_key) settings.signing_key->save(folder / "signing.key", "");
  io::throw_if_failed(io::sync_file_system(folder));
  replace_file(folder / kIdFile, random_id());
  io::throw_if_failed(io::sync_file_system(folder));
  return folder;
}

std::vector<std::string> update_other_settings(const fs::path& stick,
                                               const NodeSettings& settings) {
  const fs::path file = "studio.toml";
  const std::string studio = parse_studio(settings.files.at(file), file).name;
  std::vector<std::string> problems;
  for (const auto& folder : fs::directory_iterator(stick / "v3d")) {
    const fs::path& path = folder.path();
    const bool is_other = folder.is_directory() && path.filename() != settings.name;
    if (!is_other || !fs::exists(path / kIdFile) || fs::exists(path / "taken")) continue;
    try {
      if (load_studio(path / file).name == studio) replace_lists(path, settings);
    } catch (const std::runtime_error& error) {
      problems.emplace_back(error.what());
    }
  }
  return problems;
}

}  // namespace v3d::ctl
