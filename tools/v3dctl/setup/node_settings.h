// Settings of the members of a studio: the member list, and the settings folder of a capture PC.
#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/config/studio_file.h"
#include "base/io/unique_fd.h"
#include "wire/member_list.h"
#include "wire/secret_keys.h"
#include "wire/signatures.h"

namespace v3d::ctl {

// The member list that a studio file names.

/// Excludes other commands that change the studio file at `studio_file` or its member list, while
/// the result exists. Waits for such a command, with a note. Take it before the studio file is
/// read. Throws InputError when the file does not exist or its folder cannot be locked.
io::UniqueFd lock_studio_files(const std::filesystem::path& studio_file);

/// Throws InputError where the studio file names no member list.
void require_member_list(const Studio& studio);

/// The public key of the authority. Throws InputError where the studio file contains none or an
/// invalid one (PublicKey::parse()).
wire::PublicKey authority_of(const Studio& studio);

/// The verified member list. Throws InputError when the file cannot be read, and like
/// parse_member_list().
wire::MemberList load_member_list(const Studio& studio);

/// A member list that was changed, but not written.
struct ChangedMemberList {
  std::string text;  ///< of the file, with the signature
  int64_t serial = 0;
};

/// Applies `change` to the current list (an empty one where the file does not exist), and signs it
/// with the next serial number. `authority_file`: the secret key of the authority. The caller has
/// lock_studio_files().
///
/// Throws InputError where the studio file names no list, the key is not that of the studio's
/// authority, or the list would be invalid; and what `change` throws.
ChangedMemberList changed_member_list(const Studio& studio,
                                      const std::filesystem::path& authority_file,
                                      const std::function<void(wire::MemberList&)>& change);

// Settings folder of a capture PC: what `v3dctl node add` writes to a stick, and the appliance's
// program take-setup reads.

/// Settings of one PC.
struct NodeSettings {
  std::string name;                          ///< of the node; also the host name of its PC
  std::map<std::string, std::string> files;  ///< name and content of each file without a secret
  wire::StudioKey studio_key;
  std::optional<wire::SigningKey> signing_key;  ///< empty where the studio signs no takes
};

/// Throws InputError unless `name` can be the name of a node and of a host: small letters, digits
/// and '-', at most 63.
void require_host_name(const std::string& name);

/// The role of a node's daemon: reconstruction where the studio file says so, otherwise capture.
wire::Role role_of(const Studio& studio, std::string_view node);

/// The text of a studio file in which [[node]] `node` has this public key. A node that is missing
/// is appended. Other lines stay as they are. `public_key`: 64 hexadecimal digits; empty: only a
/// missing node is appended.
/// Throws InputError, with the line to enter by hand, where the result would not be a studio file
/// with that key; and like parse_studio().
std::string with_node(std::string_view text, const std::filesystem::path& path,
                      std::string_view node, const std::string& public_key);

/// Throws InputError where a path of the studio file is not right for an appliance: its keys,
/// calibration and member list lie in /etc/v3d, takes and background models below /var/lib/v3d.
/// `text`: of the studio file. `path`: for messages.
void require_appliance_paths(std::string_view text, const std::filesystem::path& path);

/// Text of the file with the public keys of those who may log in. Throws InputError where a line is
/// no public key.
std::string read_login_keys(const std::filesystem::path& path);

/// Text of the file time_servers. Throws InputError for a text that is no name and no address, or
/// that has more than 253 characters.
std::string time_servers_text(const std::vector<std::string>& servers);

/// Writes the settings to the new folder `stick`/v3d/NAME, and as its last file `id`, a random
/// number. Without `id`, a PC does not take the settings. All files are on the disk on return.
///
/// Where the folder exists: one without `id` is incomplete and replaced; a complete one is replaced
/// with `is_replaced` only. Throws InputError for another, where the folder holds other files, and
/// where `stick` is no folder; std::runtime_error when a file cannot be written.
std::filesystem::path write_node_settings(const std::filesystem::path& stick,
                                          const NodeSettings& settings, bool is_replaced);

/// Gives the other settings folders of the same studio on the stick, which no PC has taken, the
/// studio file and the member list of `settings`: nodes that are added later are in them, too.
/// Returns one line, with file and reason, for each folder that could not be updated.
std::vector<std::string> update_other_settings(const std::filesystem::path& stick,
                                               const NodeSettings& settings);

}  // namespace v3d::ctl
