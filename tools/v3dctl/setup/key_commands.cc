// key: makes the keys of a studio.
#include <algorithm>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "base/config/studio_file.h"
#include "base/core/error.h"
#include "base/core/text.h"
#include "base/io/shared_file.h"
#include "v3dctl/command_line.h"
#include "v3dctl/options.h"
#include "v3dctl/setup/node_settings.h"
#include "wire/member_list.h"
#include "wire/secret_keys.h"
#include "wire/signatures.h"

namespace v3d::ctl {
namespace {

int run_new(const CommandLine& line, const std::string& out) {
  // The studio key is made first: the studio file may not exist yet.
  const std::filesystem::path path = !out.empty()        ? std::filesystem::path(out)
                                     : line.has_studio() ? line.studio().network.key
                                                         : std::filesystem::path(kDefaultKey);
  if (std::filesystem::exists(path)) {
    throw InputError(
        path.string() +
        ": the studio key exists already; write a new key with --out FILE, and rename it "
        "into place on every PC");
  }
  wire::StudioKey::make().save(path);
  std::printf("made %s: copy it to every PC of the studio over an encrypted connection\n",
              path.c_str());
  return kExitDone;
}

int run_node(const CommandLine& line, const std::string& out) {
  std::filesystem::path path = out;
  if (path.empty()) path = line.studio().storage.signing_key;
  if (path.empty()) {
    throw InputError(line.studio_path().string() +
                     ": [storage] signing_key is missing; name the file there, or with --out");
  }
  const bool is_new = !std::filesystem::exists(path);
  if (is_new) wire::SigningKey::make().save(path);
  const std::string key = wire::SigningKey::load(path).public_key().text();
  std::printf("%s %s; in the studio file, under the [[node]] of this PC:\npublic_key = \"%s\"\n",
              is_new ? "made" : "read", path.c_str(), key.c_str());
  return kExitDone;
}

/// The option --out of a command that makes a key.
std::shared_ptr<std::string> add_out(cli::Command command, const std::string& otherwise) {
  command.accept_parent_options();
  auto out = std::make_shared<std::string>();
  command.add_option("--out", *out, "The file to write (" + otherwise + ")").type_name("FILE");
  return out;
}

}  // namespace

void add_key(CommandLine& line) {
  cli::Command key = line.add(
      "key", "Make the keys of a studio, and the list of its members",
      {"v3dctl key new", "v3dctl key node", "v3dctl key members",
       "v3dctl key enroll cap01 --role capture --public-key HEX", "v3dctl key revoke ada"});
  key.require_subcommand();
  cli::Command make = key.add_subcommand(
      "new", "Make the studio key, once for all PCs; its holders may command the studio");
  const auto out = add_out(make, "else as the studio file says, else /etc/v3d/studio.key");
  line.on_run(make, [&line, out] { return run_new(line, *out); });
  cli::Command node = key.add_subcommand(
      "node", "Make the signing key of this PC, if it has none, and print its public key");
  const auto node_out = add_out(node, "else [storage] signing_key of the studio file");
  line.on_run(node, [&line, node_out] { return run_node(line, *node_out); });
  add_member_commands(line, key);
}

// key authority, operator, enroll, revoke, members: the keys of an operator and of the studio's
// authority, and the member list that the authority signs.

namespace {

struct Options {
  std::string name;
  std::string role;
  std::string public_key;
  std::filesystem::path authority = "authority.key";
  std::filesystem::path out;
  bool json = false;
};

/// Applies `change` to the current list, signs it with the next serial number, and writes it.
int change_list(const CommandLine& line, const Options& options,
                const std::function<void(wire::MemberList&)>& change) {
  const io::UniqueFd lock = lock_studio_files(line.studio_path());
  const Studio studio = line.studio();
  const ChangedMemberList changed = changed_member_list(studio, options.authority, change);
  update_file(studio.network.members, changed.text);
  std::printf("wrote %s, serial number %lld: copy it to every PC of the studio\n",
              studio.network.members.c_str(), static_cast<long long>(changed.serial));
  return kExitDone;
}

int run_enroll(const CommandLine& line, const Options& options) {
  const wire::Member member{.name = options.name,
                            .role = wire::role_from_name(options.role).value(),
                            .key = wire::PublicKey::parse(options.public_key, "--public-key")};
  if (!is_file_name(member.name)) {
    throw InputError("'" + member.name + "': " + std::string(kFileNameRule));
  }
  return change_list(line, options,
                     [&](wire::MemberList& list) { list.members.push_back(member); });
}

int run_revoke(const CommandLine& line, const Options& options) {
  return change_list(line, options, [&](wire::MemberList& list) {
    const auto is_revoked = [&](const wire::Member& member) {
      const bool is_key = options.public_key.empty() || member.key.text() == options.public_key;
      return member.name == options.name && is_key;
    };
    if (std::erase_if(list.members, is_revoked) > 0) return;
    throw InputError("no member " + options.name +
                     " with such a key; v3dctl key members shows them");
  });
}

int run_members(const CommandLine& line, const Options& options) {
  const Studio studio = line.studio();
  require_member_list(studio);
  const wire::MemberList list = load_member_list(studio);
  if (options.json) {
    nlohmann::ordered_json json = {{"serial", list.serial},
                                   {"members", nlohmann::ordered_json::array()}};
    for (const wire::Member& member : list.members) {
      json["members"].push_back(
          {{"name", member.name}, {"role", name(member.role)}, {"public_key", member.key.text()}});
    }
    std::printf("%s\n", json.dump(2).c_str());
    return kExitDone;
  }
  std::printf("serial number %lld\n", static_cast<long long>(list.serial));
  for (const wire::Member& member : list.members) {
    std::printf("%-14s %-16s %s\n", std::string(name(member.role)).c_str(), member.name.c_str(),
                member.key.text().c_str());
  }
  return kExitDone;
}

int run_authority(const Options& options) {
  const wire::SigningKey key = wire::SigningKey::make();
  key.save(options.authority, "", wire::kAuthorityKey);
  std::printf(
      "made %s: do not store it on a PC of the studio; in the studio file, under [network]:\n"
      "authority = \"%s\"\n",
      options.authority.c_str(), key.public_key().text().c_str());
  return kExitDone;
}

int run_operator(const CommandLine& line, const Options& options) {
  const std::filesystem::path path =
      options.out.empty() ? line.studio().network.operator_key : options.out;
  const bool is_new = !std::filesystem::exists(path);
  if (is_new) wire::SigningKey::make().save(path, "v3d", wire::kOperatorKey);
  const std::string key = wire::SigningKey::load(path, wire::kOperatorKey).public_key().text();
  std::printf(
      "%s %s; run on the PC that has the authority's key:\n"
      "v3dctl key enroll NAME --role operator --public-key %s\n",
      is_new ? "made" : "read", path.c_str(), key.c_str());
  return kExitDone;
}

void add_authority_option(cli::Command command, Options& options, const std::string& what) {
  command.add_option("--authority", options.authority, what).type_name("FILE").show_default();
}

/// A command on one member.
cli::Command add_for_member(cli::Command key, Options& options, const std::string& verb,
                            const std::string& purpose) {
  cli::Command command = key.add_subcommand(verb, purpose);
  command.accept_parent_options();
  command.add_option("name", options.name, "The member: a node of the studio file, or a person")
      .required()
      .type_name("NAME");
  add_authority_option(command, options, "The file of the authority's key");
  return command;
}

cli::Command add_plain(cli::Command key, const std::string& verb, const std::string& purpose) {
  cli::Command command = key.add_subcommand(verb, purpose);
  command.accept_parent_options();
  return command;
}

}  // namespace

void add_member_commands(CommandLine& line, cli::Command key) {
  auto options = std::make_shared<Options>();
  cli::Command operators =
      add_plain(key, "operator",
                "Make the key of this PC's operator, if there is none, and print its public key");
  operators
      .add_option("--out", options->out,
                  "The file to write (otherwise [network] operator_key of the studio file)")
      .type_name("FILE");
  line.on_run(operators, [&line, options] { return run_operator(line, *options); });

  cli::Command authority =
      add_plain(key, "authority", "Make the key that signs the member list, once for a studio");
  add_authority_option(authority, *options, "The file to write");
  line.on_run(authority, [options] { return run_authority(*options); });

  cli::Command enroll =
      add_for_member(key, *options, "enroll", "Add a member, or a key of a member");
  enroll.add_option("--role", options->role, "Role of the member")
      .required()
      .type_name("ROLE")
      .check(cli::one_of({"operator", "capture", "reconstruction", "viewer"}));
  enroll.add_option("--public-key", options->public_key, "As key node or key operator prints it")
      .required()
      .type_name("HEX");
  line.on_run(enroll, [&line, options] { return run_enroll(line, *options); });

  cli::Command revoke = add_for_member(key, *options, "revoke", "Remove a member");
  revoke.add_option("--public-key", options->public_key, "Only this key of the member")
      .type_name("HEX");
  line.on_run(revoke, [&line, options] { return run_revoke(line, *options); });

  cli::Command members = add_plain(key, "members", "Verify the member list, and show it");
  add_json_flag(members, options->json);
  line.on_run(members, [&line, options] { return run_members(line, *options); });
}

}  // namespace v3d::ctl
