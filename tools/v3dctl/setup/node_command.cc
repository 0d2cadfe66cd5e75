// node add: prepares a stick from which an appliance takes its settings at its first start.
#include <unistd.h>

#include <algorithm>
#include <cstdio>

#include "base/config/calib_file.h"
#include "base/core/error.h"
#include "base/core/text.h"
#include "base/io/file.h"
#include "base/io/shared_file.h"
#include "v3dctl/command_line.h"
#include "v3dctl/setup/node_settings.h"

namespace v3d::ctl {
namespace {

namespace fs = std::filesystem;

struct Options {
  std::string name;
  fs::path out;
  fs::path calib;
  fs::path key;
  fs::path authority = "authority.key";
  fs::path crew_keys;
  fs::path root_keys;
  std::vector<std::string> networks;
  std::vector<std::string> time_servers;
  std::vector<std::string> pcs;
  bool replace = false;
};

/// The studio's files after the node was added. They are written after the stick, so that a stick
/// that cannot be written changes nothing.
struct StudioFiles {
  Studio studio;             ///< with the node
  std::string studio_text;   ///< of the studio file
  std::string members_text;  ///< of the member list; empty without one
  int64_t serial = 0;        ///< of the member list
};

/// Without a member list, the studio file alone has the key with which the node's takes verify.
void require_no_public_key(const Studio& studio, const std::string& name) {
  const auto node = std::ranges::find(studio.nodes, name, &StudioNode::name);
  if (node == studio.nodes.end() || node->public_key.empty()) return;
  throw InputError(studio.path.string() + ": " + name +
                   " has a public key already; --replace gives it a new one, with which its "
                   "earlier takes do not verify");
}

/// Adds the node to the studio file and, where there is one, to the member list. Writes nothing.
StudioFiles add_to_studio(const CommandLine& line, const Options& options,
                          const std::optional<wire::SigningKey>& key) {
  const fs::path path = line.studio_path();
  const std::string public_key = key ? key->public_key().text() : "";
  const Studio before = parse_studio(read_file(path), path);
  if (key && before.network.members.empty() && !options.replace) {
    require_no_public_key(before, options.name);
  }
  StudioFiles files;
  files.studio_text = with_node(read_file(path), path, options.name, public_key);
  files.studio = parse_studio(files.studio_text, path);
  if (files.studio.network.members.empty()) return files;
  const wire::Member member{
      .name = options.name, .role = role_of(files.studio, options.name), .key = key->public_key()};
  const ChangedMemberList changed =
      changed_member_list(files.studio, options.authority, [&](wire::MemberList& list) {
        const auto count = std::erase_if(
            list.members, [&](const wire::Member& other) { return other.name == member.name; });
        if (count > 0 && !options.replace) {
          throw InputError(member.name +
                           " is a member already; --replace gives it a new key instead of its own");
        }
        list.members.push_back(member);
      });
  files.members_text = changed.text;
  files.serial = changed.serial;
  return files;
}

void add_network_files(const std::vector<std::string>& paths, NodeSettings& settings) {
  for (const fs::path path : paths) {
    const fs::path name = path.filename();
    if ((name.extension() != ".network" && name.extension() != ".link") ||
        !is_file_name(name.string())) {
      throw InputError("--network " + path.string() +
                       ": expected a name that ends in .network or .link");
    }
    settings.files[name] = read_file(path);
  }
}

std::string pc_text(const std::vector<std::string>& pcs) {
  std::string text;
  for (const std::string& pc : pcs) {
    if (pc.empty() || printable(pc) != pc) {
      throw InputError("--pc '" + pc + "': expected a MAC address or a serial number");
    }
    text += pc + "\n";
  }
  return text;
}

NodeSettings settings_of(const Options& options, const StudioFiles& files,
                         const std::optional<wire::SigningKey>& key) {
  const Studio& studio = files.studio;
  const fs::path calib = options.calib.empty() ? studio.storage.calib : options.calib;
  load_calib(calib);
  NodeSettings settings{
      .name = options.name,
      .files = {{"hostname", options.name + "\n"},
                {"role", std::string(name(role_of(studio, options.name))) + "\n"},
                {"studio.toml", files.studio_text},
                {"calib.toml", read_file(calib)}},
      .studio_key = wire::StudioKey::load(options.key.empty() ? studio.network.key : options.key),
      .signing_key = key};
  if (!files.members_text.empty()) settings.files["members.toml"] = files.members_text;
  if (!options.crew_keys.empty()) {
    settings.files["authorized_keys"] = read_login_keys(options.crew_keys);
  }
  if (!options.root_keys.empty()) {
    settings.files["root_authorized_keys"] = read_login_keys(options.root_keys);
  }
  if (!options.time_servers.empty()) {
    settings.files["time_servers"] = time_servers_text(options.time_servers);
  }
  if (!options.pcs.empty()) settings.files["pc"] = pc_text(options.pcs);
  add_network_files(options.networks, settings);
  return settings;
}

/// Throws InputError unless this file can be replaced: a PC must not get a key that no list has.
void require_replaceable(const fs::path& path) {
  const fs::path folder = fs::weakly_canonical(fs::absolute(path)).parent_path();
  if (access(folder.c_str(), W_OK | X_OK) == 0) return;
  throw InputError(errno_message(folder.string()) + "; v3dctl node add enters the node in " +
                   path.filename().string());
}

/// Comes after the studio's files: a PC takes the new folder also where another one is damaged.
int update_other_folders(const fs::path& stick, const NodeSettings& settings) {
  const std::vector<std::string> problems = update_other_settings(stick, settings);
  for (const std::string& problem : problems) {
    std::fprintf(stderr,
                 "%s; this folder does not have the new node: add its node again, with --replace\n",
                 problem.c_str());
  }
  return problems.empty() ? kExitDone : kExitIncomplete;
}

int run_add(const CommandLine& line, const Options& options) {
  require_host_name(options.name);
  const io::UniqueFd lock = lock_studio_files(line.studio_path());
  std::optional<wire::SigningKey> key;
  const Studio before = line.studio();
  if (!before.storage.signing_key.empty()) key = wire::SigningKey::make();
  const StudioFiles files = add_to_studio(line, options, key);
  require_appliance_paths(files.studio_text, before.path);
  const NodeSettings settings = settings_of(options, files, key);
  const bool changes_studio = files.studio_text != read_file(before.path);
  if (changes_studio) require_replaceable(before.path);
  if (!files.members_text.empty()) require_replaceable(before.network.members);
  const fs::path folder = write_node_settings(options.out, settings, options.replace);

  std::printf(
      "wrote %s: unmount the stick (label V3D-SETUP), plug it into the PC, and switch it on\n",
      folder.c_str());
  if (changes_studio) {
    update_file(before.path, files.studio_text);
    std::printf("changed %s: copy it to every PC of the studio\n", before.path.c_str());
  }
  if (!files.members_text.empty()) {
    update_file(before.network.members, files.members_text);
    std::printf("wrote %s, serial number %lld: copy it to every PC of the studio\n",
                before.network.members.c_str(), static_cast<long long>(files.serial));
  }
  return update_other_folders(options.out, settings);
}

}  // namespace

void add_node(CommandLine& line) {
  cli::Command node =
      line.add("node", "Prepare a stick with the settings of a new PC of the studio",
               {"v3dctl node add cap07 --out /media/V3D-SETUP --ssh-key crew.pub",
                "v3dctl node add cap08 --out /media/V3D-SETUP --pc 00:1b:21:3a:4f:07 --network "
                "lan.network"});
  node.require_subcommand();
  cli::Command add = node.add_subcommand(
      "add", "Make the keys of a node, add it to the studio, and write its settings to a stick");
  add.accept_parent_options();
  auto options = std::make_shared<Options>();
  add.add_option("name", options->name, "The node, and the host name of its PC")
      .required()
      .type_name("NAME");
  add.add_option("--out", options->out, "Where the stick is mounted")
      .required()
      .type_name("FOLDER");
  add.add_option("--calib", options->calib, "The calibration (otherwise that of the studio file)")
      .type_name("FILE");
  add.add_option("--key", options->key, "The studio key (otherwise that of the studio file)")
      .type_name("FILE");
  add.add_option("--authority", options->authority,
                 "With a member list: the file of the authority's key")
      .type_name("FILE")
      .show_default();
  add.add_option("--ssh-key", options->crew_keys, "Public keys of those who may log in as crew")
      .type_name("FILE");
  add.add_option("--root-key", options->root_keys, "Public keys of those who may log in as root")
      .type_name("FILE");
  add.add_option("--network", options->networks,
                 "A *.network or *.link file of systemd.network (may be repeated)")
      .type_name("FILE")
      .take_one_word();
  add.add_option("--time-server", options->time_servers,
                 "Name or address of a time server (may be repeated; otherwise Debian's)")
      .type_name("SERVER")
      .take_one_word();
  add.add_option("--pc", options->pcs,
                 "MAC address or serial number of the PC (may be repeated; otherwise the next PC)")
      .type_name("ID")
      .take_one_word();
  add.add_flag("--replace", options->replace,
               "Replace the settings on the stick, and the signing key of the node");
  line.on_run(add, [&line, options] { return run_add(line, *options); });
}

}  // namespace v3d::ctl
