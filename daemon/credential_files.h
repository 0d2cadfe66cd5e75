// The key files of a process, read again while it runs: a key is replaced without a restart.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "base/time.h"
#include "daemon/credentials.h"
#include "daemon/message_seal.h"

namespace v3d {

/// A file that disappears or becomes unreadable, as while it is copied, changes nothing: the key
/// that was read before stays in use. One thread.
class CredentialFiles {
 public:
  /// `credentials` and `seal` get what is read, and outlive this.
  CredentialFiles(std::filesystem::path studio_key, Credentials& credentials, MessageSeal& seal);

  /// Reads the files; to be called about once a second. One line for the log when something changed
  /// since the last call, else empty.
  std::string poll(MonotonicInstant now);
  /// Whether there is what commands and replies need.
  bool is_ready() const { return key_.has_value(); }
  /// One line: what is wrong with a file, and the remedy; else empty.
  const std::string& problem() const { return problem_; }

 private:
  std::string read_key(MonotonicInstant now);

  const std::filesystem::path key_file_;
  Credentials& credentials_;
  MessageSeal& seal_;
  std::optional<StudioKey> key_;
  std::string problem_;
};

}  // namespace v3d
