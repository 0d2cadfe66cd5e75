// key: makes the keys of a studio. The member list: member_commands.cc.
#include <cstdio>

#include "base/config/studio_file.h"
#include "base/core/error.h"
#include "v3dctl/command_line.h"
#include "wire/signing_key.h"
#include "wire/studio_key.h"

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
  StudioKey::make().save(path);
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
  if (is_new) SigningKey::make().save(path);
  const std::string key = SigningKey::load(path).public_key().text();
  std::printf("%s %s; in the studio file, under the [[node]] of this PC:\npublic_key = \"%s\"\n",
              is_new ? "made" : "read", path.c_str(), key.c_str());
  return kExitDone;
}

/// The option --out of a command that makes a key.
std::shared_ptr<std::string> add_out(CLI::App* command, const std::string& otherwise) {
  command->fallthrough();
  auto out = std::make_shared<std::string>();
  command->add_option("--out", *out, "Where to write it (" + otherwise + ")")->type_name("FILE");
  return out;
}

}  // namespace

void add_key(CommandLine& line) {
  CLI::App* key = line.add(
      "key", "Make the keys of a studio, and the list of its members",
      {"v3dctl key new", "v3dctl key node", "v3dctl key members",
       "v3dctl key enroll cap01 --role capture --public-key HEX", "v3dctl key revoke ada"});
  key->require_subcommand(1);
  CLI::App* make = key->add_subcommand(
      "new", "Make the studio key, once for all PCs; its holders may command the studio");
  const auto out = add_out(make, "else as the studio file says, else /etc/v3d/studio.key");
  line.on_run(make, [&line, out] { return run_new(line, *out); });
  CLI::App* node = key->add_subcommand(
      "node", "Make the signing key of this PC, if it has none, and print its public key");
  const auto node_out = add_out(node, "else [storage] signing_key of the studio file");
  line.on_run(node, [&line, node_out] { return run_node(line, *node_out); });
  add_member_commands(line, key);
}

}  // namespace v3d::ctl
