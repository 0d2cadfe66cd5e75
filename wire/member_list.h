// List of the members of a studio, with their roles and public keys. The authority of the studio
// signs the list; its key lies on no PC of the studio.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "wire/signatures.h"

namespace v3d::wire {

/// Role of a member: what it may sign. An operator signs commands. Nodes (capture, reconstruction)
/// sign replies, health, events and the other channels of their role (daemon/bus/channel_list.h). A
/// viewer signs none of these.
enum class Role : uint8_t { kOperator = 1, kCapture, kReconstruction, kViewer };
std::string_view name(Role role);
std::optional<Role> role_from_name(std::string_view name);
inline constexpr std::string_view kRoleNames = "operator, capture, reconstruction, viewer";

/// One key of a member. A member with several keys, for example during a rotation, has several
/// entries with the same name and role. Members of one PC may share a key.
struct Member {
  std::string name;  ///< name of a node in the studio file, or of a person
  Role role = Role::kViewer;
  PublicKey key;

  bool is_node() const { return role == Role::kCapture || role == Role::kReconstruction; }
  friend bool operator==(const Member&, const Member&) = default;
};

struct MemberList {
  std::string studio;  ///< name of the studio
  int64_t serial = 0;  ///< increases with every change, from 1
  std::vector<Member> members;

  /// The entries whose key signed `message`. Verifies at most one signature for each key.
  std::vector<const Member*> signers_of(const SignedMessage& message) const;
  /// The same for a message on the bus (bus_statement()). Computes no hash when no entry has the
  /// key.
  std::vector<const Member*> signers_of(SignedMessage message, const MessageOrigin& origin) const;
};

inline constexpr uint64_t kMaxMemberListBytes = 1 << 20;

/// Returns the text of the file with the signature of the authority. parse_member_list() reads it.
std::string sign_member_list(const MemberList& list, const SigningKey& authority);
/// Reads the text of the file. Parses it only after the signature has been verified.
/// Throws InputError with file, line and field when the signature is not from `authority`, the list
/// belongs to another studio, or an entry is invalid.
MemberList parse_member_list(std::string_view text, const std::filesystem::path& path,
                             const PublicKey& authority, std::string_view studio);

}  // namespace v3d::wire
