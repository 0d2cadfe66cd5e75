#include "wire/member_list.h"

#include <algorithm>
#include <array>
#include <utility>

#include "base/config/toml_file.h"
#include "base/core/error.h"
#include "base/core/text.h"
#include "wire/signatures.h"

namespace v3d::wire {
namespace {

constexpr std::string_view kKind = "v3d member list, version 1";
constexpr size_t kMaxMembers = 1000;
constexpr std::array<std::pair<Role, std::string_view>, 4> kRoles = {
    {{Role::kOperator, "operator"},
     {Role::kCapture, "capture"},
     {Role::kReconstruction, "reconstruction"},
     {Role::kViewer, "viewer"}}};

Member read_member(const TomlTable& table) {
  Member member{.name = table.text("name"), .key = {}};
  if (!is_file_name(member.name)) table.fail("name", std::string(kFileNameRule));
  const auto role = role_from_name(table.text("role"));
  if (!role) table.fail("role", "expected one of " + std::string(kRoleNames));
  member.role = *role;
  const auto key = PublicKey::from_text(table.text("public_key"));
  if (!key) table.fail("public_key", "expected 64 hexadecimal digits");
  member.key = *key;
  table.reject_unknown_fields();
  return member;
}

void add_member(const TomlTable& table, std::vector<Member>& members) {
  Member member = read_member(table);
  for (const Member& other : members) {
    if (other.name != member.name) continue;
    if (other.role != member.role)
      table.fail("role", "an earlier entry gives this member another role");
    if (other.key == member.key)
      table.fail("public_key", "an earlier entry gives this member the same key");
  }
  members.push_back(std::move(member));
}

}  // namespace

std::string_view name(Role role) {
  return std::ranges::find(kRoles, role, &std::pair<Role, std::string_view>::first)->second;
}

std::optional<Role> role_from_name(std::string_view name) {
  const auto* const found =
      std::ranges::find(kRoles, name, &std::pair<Role, std::string_view>::second);
  if (found == kRoles.end()) return std::nullopt;
  return found->first;
}

std::vector<const Member*> MemberList::signers_of(const SignedMessage& message) const {
  std::vector<const Member*> signers;
  for (const Member& member : members) {
    if (id_of(member.key) != message.key_id) continue;
    const bool is_known = !signers.empty() && signers.front()->key == member.key;
    if (is_known || message.is_signed_by(member.key)) signers.push_back(&member);
  }
  return signers;
}

std::vector<const Member*> MemberList::signers_of(SignedMessage message,
                                                  const MessageOrigin& origin) const {
  const auto has_key = [&](const Member& member) { return id_of(member.key) == message.key_id; };
  if (std::ranges::none_of(members, has_key)) return {};
  const BusStatement statement = bus_statement(message.signed_bytes, origin);
  message.signed_bytes = statement;
  return signers_of(message);
}

std::string sign_member_list(const MemberList& list, const SigningKey& authority) {
  TomlWriter text;
  text.text("kind", kKind).text("studio", list.studio).integer("serial", list.serial);
  for (const Member& member : list.members) {
    text.element("member")
        .text("name", member.name)
        .text("role", name(member.role))
        .text("public_key", member.key.text());
  }
  return sign_text(text.written(), authority);
}

MemberList parse_member_list(std::string_view text, const std::filesystem::path& path,
                             const PublicKey& authority, std::string_view studio) {
  const SignedText signed_text = split_signed_text(text, path);
  if (!signed_text.is_signed_by(authority)) {
    throw InputError(path.string() +
                     ": not signed by [network] authority of the studio file: the list was changed "
                     "or signed by another authority");
  }
  const TomlTable table = TomlTable::parse(signed_text.text, path);
  if (table.text("kind") != kKind) table.fail("kind", "expected '" + std::string(kKind) + "'");
  MemberList list{.studio = table.text("studio"), .serial = table.integer("serial"), .members = {}};
  if (list.studio != studio) {
    table.fail("studio", "expected '" + std::string(studio) + "', as in the studio file");
  }
  if (list.serial < 1) table.fail("serial", "expected 1 or more");
  const std::vector<TomlTable> members = table.tables("member");
  if (members.size() > kMaxMembers) table.fail("member", "expected 1000 entries at most");
  for (const TomlTable& member : members) add_member(member, list.members);
  table.reject_unknown_fields();
  return list;
}

}  // namespace v3d::wire
