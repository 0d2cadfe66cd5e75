// Who belongs to a studio, in which role, with which public keys. The studio's authority, a key
// that is on none of its PCs, signs the list.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "wire/message_signature.h"
#include "wire/signing_key.h"

namespace v3d {

/// What a member may sign: an operator commands; nodes (capture, reconstruction) reply and send
/// health, events and what else is theirs (daemon/bus/channel_list.h); a viewer nothing of this.
enum class Role : uint8_t { kOperator = 1, kCapture, kReconstruction, kViewer };
std::string_view name(Role role);
std::optional<Role> role_from_name(std::string_view name);
inline constexpr std::string_view kRoleNames = "operator, capture, reconstruction, viewer";

/// One key of a member. A member with several keys, as while a key is replaced, has several
/// entries with one name and role. Members of one PC may share a key.
struct Member {
  std::string name;  ///< a node's name in the studio file, or that of a person
  Role role = Role::kViewer;
  PublicKey key;

  bool is_node() const { return role == Role::kCapture || role == Role::kReconstruction; }
  friend bool operator==(const Member&, const Member&) = default;
};

struct MemberList {
  std::string studio;  ///< its name
  int64_t serial = 0;  ///< rises with every change, from 1
  std::vector<Member> members;

  /// The entries whose key has signed `message`. Verifies one signature at most for each key.
  std::vector<const Member*> signers_of(const SignedMessage& message) const;
  /// The same of a message on the bus (bus_statement()). Hashes nothing when no entry has the key.
  std::vector<const Member*> signers_of(SignedMessage message, const MessageOrigin& origin) const;
};

inline constexpr uint64_t kMaxMemberListBytes = 1 << 20;

/// The file's text, signed by the authority. Read back by parse_member_list().
std::string sign_member_list(const MemberList& list, const SigningKey& authority);
/// Reads nothing behind a wrong signature. Throws InputError with file, line and field when the
/// signature is not the authority's, the list is another studio's, or an entry is wrong.
MemberList parse_member_list(std::string_view text, const std::filesystem::path& path,
                             const PublicKey& authority, std::string_view studio);

}  // namespace v3d
