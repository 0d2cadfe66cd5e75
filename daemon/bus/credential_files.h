// Keys and member list on disk.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "base/config/studio_file.h"
#include "base/core/time.h"
#include "base/io/file.h"
#include "daemon/bus/credentials.h"
#include "daemon/bus/message_authenticator.h"

namespace v3d::bus {

// The highest serial number of a member list that a node has accepted, in a file, so that an older
// list is rejected after a restart too.

/// The file of one node. It belongs to a studio and an authority: the lists of another authority
/// have serial numbers of their own. One thread.
class AcceptedSerial {
 public:
  /// `path`: the file; empty: nothing is read or saved. `authority`: its public key, hexadecimal.
  AcceptedSerial(std::filesystem::path path, std::string studio, std::string authority);

  const std::filesystem::path& path() const { return path_; }
  /// The number in the file; 0 when there is no file, or when it belongs to another studio or
  /// authority. Throws InputError with path and cause when it cannot be read or is damaged.
  int64_t load() const;
  /// Replaces the file atomically.
  [[nodiscard]] io::Status save(int64_t serial) const;

 private:
  const std::filesystem::path path_;
  const std::string studio_, authority_;
};

// Reads the key files and the member list of a process repeatedly, so that keys and members are
// replaced without a restart.

/// The key files of a process, and the member as which it signs.
struct CredentialPaths {
  std::string studio;  ///< its name
  std::filesystem::path studio_key;
  std::filesystem::path members = {};  ///< empty: there is no member list
  std::string authority = {};          ///< public key that verifies the list, hexadecimal
  /// Signs the takes of a capture node and, where there is a member list, the messages of every
  /// node and operator. Empty: none.
  std::filesystem::path signing_key = {};
  /// File with the highest serial number that was accepted (AcceptedSerial). Empty: it is not kept
  /// over a restart, as for an operator.
  std::filesystem::path accepted_serial = {};
  std::string node = {};  ///< empty: an operator
  wire::Role role = wire::Role::kOperator;
};
CredentialPaths credentials_of_node(const Studio& studio, const std::string& node);
CredentialPaths credentials_of_operator(const Studio& studio);

/// A member list with a lower serial number than one that was accepted is rejected. A node keeps
/// that number in a file; where it cannot be written, problem() reports it and the node continues.
///
/// When a file is missing, unreadable or rejected (for example while it is being copied), the
/// previous contents stay in use. One thread.
class CredentialFiles {
 public:
  /// Passes the keys and the list to `credentials` and `authenticator`, which must outlive this
  /// object. A node reads its signing key with the first poll(), an operator after start_signing().
  /// Throws InputError when the authority is not a public key.
  CredentialFiles(CredentialPaths paths, Credentials& credentials,
                  MessageAuthenticator& authenticator);

  /// Makes poll() read the signing key too. To be called before the process sends commands.
  void start_signing() { signs_ = true; }
  /// Reads the files; to be called about once a second. Returns one line for the log when something
  /// changed since the last call; otherwise empty.
  std::string poll(MonotonicInstant now);

  bool has_studio_key() const { return key_.has_value(); }
  /// The signing key as last read; empty before.
  const std::optional<wire::SigningKey>& signing_key() const { return own_; }
  /// Whether all keys and lists that this process needs to accept commands and to sign were read.
  bool is_ready() const;
  /// One line with the remedy when a file is wrong or this process is not a member; otherwise
  /// empty.
  std::string problem() const;
  /// Why other processes would reject the signatures of this process; otherwise empty.
  std::string obstacle() const { return is_ready() ? not_member_ : problem(); }

 private:
  template <class Read>
  std::string try_to(Read read, const std::string& what, bool is_in_use, std::string& problem,
                     const std::string& effect_of_none = "");
  std::string read_studio_key(MonotonicInstant now);
  std::string read_members();
  void reject_older(const wire::MemberList& read) const;
  std::string load_accepted_serial();
  std::string save_accepted_serial();
  bool reads_signing_key() const;
  std::string read_signing_key();
  std::string why_not_member() const;

  const CredentialPaths paths_;
  const std::optional<wire::PublicKey> authority_;
  Credentials& credentials_;
  MessageAuthenticator& authenticator_;
  bool signs_;
  std::optional<wire::StudioKey> key_;
  std::shared_ptr<const wire::MemberList> members_;
  std::string members_text_;  ///< of the list that is in force
  AcceptedSerial accepted_;
  std::optional<int64_t> accepted_serial_;  ///< in its file; empty before the first list
  std::optional<wire::SigningKey> own_;
  std::string key_problem_, members_problem_, signing_problem_, serial_problem_, not_member_;
};

}  // namespace v3d::bus
