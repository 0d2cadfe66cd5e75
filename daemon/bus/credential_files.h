// The files of a process's keys and of the member list, read again while it runs: keys and members
// are replaced without a restart.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "base/config/studio_file.h"
#include "base/core/time.h"
#include "daemon/bus/credentials.h"
#include "daemon/bus/message_seal.h"

namespace v3d {

/// Where a process finds its keys, and as which member it signs.
struct CredentialPaths {
  std::string studio;  ///< its name
  std::filesystem::path studio_key;
  std::filesystem::path members = {};      ///< empty: there is no member list
  std::string authority = {};              ///< public key that verifies the list, hexadecimal
  std::filesystem::path signing_key = {};  ///< used where there is a member list
  std::string node = {};                   ///< empty: an operator
  Role role = Role::kOperator;
};
CredentialPaths credentials_of_node(const Studio& studio, const std::string& node);
CredentialPaths credentials_of_operator(const Studio& studio);

/// A file that disappears, becomes unreadable or is rejected, as while it is copied, changes
/// nothing: what was read before stays in use. One thread.
class CredentialFiles {
 public:
  /// `credentials` and `seal` get what is read, and outlive this. A node reads its signing key with
  /// the first poll(), an operator after start_signing(). Throws InputError when the authority is
  /// no public key.
  CredentialFiles(CredentialPaths paths, Credentials& credentials, MessageSeal& seal);

  /// From now on the process sends commands: its signing key is read too.
  void start_signing() { signs_ = true; }
  /// Reads the files; to be called about once a second. One line for the log when something changed
  /// since the last call, else empty.
  std::string poll(MonotonicInstant now);

  bool has_studio_key() const { return key_.has_value(); }
  /// Whether there is what this process needs to accept commands and to sign.
  bool is_ready() const;
  /// One line: what is wrong with a file, or that this process is no member, with the remedy; else
  /// empty.
  std::string problem() const;
  /// Why others do not accept what this process would sign; else empty.
  std::string obstacle() const { return is_ready() ? not_member_ : problem(); }

 private:
  template <class Read>
  std::string try_to(Read read, const std::string& what, bool is_in_use, std::string& problem);
  std::string read_studio_key(MonotonicInstant now);
  std::string read_members();
  std::string read_signing_key();
  std::string why_not_member() const;

  const CredentialPaths paths_;
  const std::optional<PublicKey> authority_;
  Credentials& credentials_;
  MessageSeal& seal_;
  bool signs_;
  std::optional<StudioKey> key_;
  std::shared_ptr<const MemberList> members_;
  std::string members_text_;  ///< of the list that is in force
  std::optional<PublicKey> own_;
  std::string key_problem_, members_problem_, signing_problem_, not_member_;
};

}  // namespace v3d
