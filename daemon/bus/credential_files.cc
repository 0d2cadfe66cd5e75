#include "daemon/bus/credential_files.h"

#include <algorithm>
#include <cerrno>
#include <system_error>
#include <utility>

#include "base/config/toml_file.h"
#include "base/core/error.h"
#include "base/io/file.h"
#include "wire/secret_keys.h"

namespace v3d::bus {
namespace {

std::string read_text(const std::filesystem::path& path) {
  auto text = io::read_file(path, wire::kMaxMemberListBytes);
  if (text) return *std::move(text);
  const char* const remedy =
      text.error().code == ENOENT ? "; v3dctl key enroll makes it, copy it to every PC" : "";
  throw InputError(text.error().message + remedy);
}

CredentialPaths common_paths(const Studio& studio) {
  return {.studio = studio.name,
          .studio_key = studio.network.key,
          .members = studio.network.members,
          .authority = studio.network.authority};
}

}  // namespace

CredentialPaths credentials_of_node(const Studio& studio, const std::string& node) {
  CredentialPaths paths = common_paths(studio);
  paths.signing_key = studio.storage.signing_key;
  paths.node = node;
  if (!studio.storage.takes.empty()) {
    paths.accepted_serial = studio.storage.takes / (".member-list-" + node);
  }
  paths.role = studio.reconstructs(node) ? wire::Role::kReconstruction : wire::Role::kCapture;
  return paths;
}

CredentialPaths credentials_of_operator(const Studio& studio) {
  CredentialPaths paths = common_paths(studio);
  paths.signing_key = studio.network.operator_key;
  return paths;
}

CredentialFiles::CredentialFiles(CredentialPaths paths, Credentials& credentials,
                                 MessageAuthenticator& authenticator)
    : paths_(std::move(paths)),
      authority_(paths_.members.empty() ? std::nullopt
                                        : std::optional(wire::PublicKey::parse(
                                              paths_.authority, "network.authority"))),
      credentials_(credentials),
      authenticator_(authenticator),
      signs_(!paths_.node.empty()),
      accepted_(paths_.accepted_serial, paths_.studio, paths_.authority) {
  if (paths_.members.empty()) return;
  credentials_.require_members();
  authenticator_.members().require();
}

std::string CredentialFiles::poll(MonotonicInstant now) {
  credentials_.discard_old_key(now);
  authenticator_.discard_old_key(now);
  std::string changes =
      try_to([&] { return read_studio_key(now); }, "studio key", key_.has_value(), key_problem_);
  const auto add = [&](const std::string& line) {
    changes += line.empty() || changes.empty() ? line : "; " + line;
  };
  if (!paths_.members.empty()) {
    add(try_to([&] { return read_members(); }, "member list", members_ != nullptr,
               members_problem_));
    add(save_accepted_serial());
  }
  if (!reads_signing_key()) return changes;
  add(try_to([&] { return read_signing_key(); }, "signing key", own_.has_value(), signing_problem_,
             paths_.members.empty() ? "takes are not signed: " : ""));
  const std::string before = std::exchange(not_member_, why_not_member());
  if (not_member_ != before) add(not_member_);
  return changes;
}

/// Calls `read` and returns its line for the log. Stores the message of an InputError in `problem`,
/// and returns it when it differs from the previous one. `effect_of_none`: the effect of the error
/// when nothing is in use.
template <class Read>
std::string CredentialFiles::try_to(Read read, const std::string& what, bool is_in_use,
                                    std::string& problem, const std::string& effect_of_none) {
  try {
    const std::string change = read();
    const bool was_wrong = !std::exchange(problem, "").empty();
    return change.empty() && was_wrong ? "the " + what + " is readable again" : change;
  } catch (const InputError& error) {
    const std::string effect =
        is_in_use ? "the previous " + what + " stays in use: " : effect_of_none;
    const std::string before = std::exchange(problem, effect + error.what());
    return problem == before ? "" : problem;
  }
}

std::string CredentialFiles::read_studio_key(MonotonicInstant now) {
  const wire::StudioKey read = wire::StudioKey::load(paths_.studio_key);
  if (key_ && *key_ == read) return "";
  const bool is_first = !key_;
  key_ = read;
  credentials_.set_studio_key(read, now);
  authenticator_.set_key(read, now);
  if (is_first) return "";
  return paths_.studio_key.string() +
         ": a new studio key; messages carry it in 10 s, and the old one is accepted for 20 s";
}

std::string CredentialFiles::read_members() {
  const std::string text = read_text(paths_.members);
  if (members_ && text == members_text_) return "";
  const auto read = std::make_shared<const wire::MemberList>(
      parse_member_list(text, paths_.members, *authority_, paths_.studio));
  const std::string note = load_accepted_serial();
  reject_older(*read);
  const bool is_first = !members_;
  members_ = read;
  members_text_ = text;
  credentials_.set_members(read);
  authenticator_.members().set_members(read);
  if (is_first) return note;
  return paths_.members.string() + ": member list " + std::to_string(read->serial) + " is in force";
}

/// Rejects a list with a lower serial number, also than before a restart: an older list would
/// restore revoked members. While the process runs, another list needs a higher number.
void CredentialFiles::reject_older(const wire::MemberList& read) const {
  const auto reject = [&](const std::string& expected) {
    throw InputError(paths_.members.string() + ": serial: expected " + expected + "; found " +
                     std::to_string(read.serial));
  };
  if (members_ && read.serial <= members_->serial) {
    reject("more than " + std::to_string(members_->serial) + ", which is in force");
  }
  if (accepted_serial_ && read.serial < *accepted_serial_) {
    reject("at least " + std::to_string(*accepted_serial_) +
           ", which this node accepted before its restart (" + accepted_.path().string() + ")");
  }
}

/// Reads the number once. A damaged file does not stop the node: it is reported and replaced.
std::string CredentialFiles::load_accepted_serial() {
  if (accepted_serial_) return "";
  accepted_serial_ = 0;
  try {
    accepted_serial_ = accepted_.load();
  } catch (const InputError& error) {
    return std::string(error.what()) +
           "; the serial number of the member list is not compared with that before the restart";
  }
  return "";
}

/// Tries again with each poll() while the file cannot be written. Returns a new problem.
std::string CredentialFiles::save_accepted_serial() {
  if (!members_ || accepted_serial_ == members_->serial) return "";
  const io::Status saved = accepted_.save(members_->serial);
  if (saved) accepted_serial_ = members_->serial;
  // The message of the error names a temporary file, which differs each time.
  const std::string problem =
      saved ? ""
            : "cannot write " + accepted_.path().string() + ": " +
                  std::generic_category().message(saved.error().code) +
                  "; after a restart, this node would accept an older member list";
  const bool is_new = std::exchange(serial_problem_, problem) != problem;
  return is_new ? problem : "";
}

/// Without a member list, only a capture node has something to sign: its takes.
bool CredentialFiles::reads_signing_key() const {
  const bool is_used = !paths_.members.empty() || paths_.role == wire::Role::kCapture;
  return signs_ && is_used && !paths_.signing_key.empty();
}

std::string CredentialFiles::read_signing_key() {
  const wire::KeyKind& kind = paths_.node.empty() ? wire::kOperatorKey : wire::kNodeKey;
  const wire::SigningKey read = wire::SigningKey::load(paths_.signing_key, kind);
  if (own_ && own_->public_key() == read.public_key()) return "";
  const bool is_first = !own_;
  own_ = read;
  credentials_.set_signing_key(read);
  authenticator_.members().set_signing_key(read);
  return is_first ? "" : paths_.signing_key.string() + ": a new " + std::string(kind.name);
}

std::string CredentialFiles::why_not_member() const {
  if (!members_ || !own_) return "";
  const wire::PublicKey own = own_->public_key();
  const auto is_own = [&](const wire::Member& m) {
    return m.key == own && m.role == paths_.role && (paths_.node.empty() || m.name == paths_.node);
  };
  if (std::ranges::any_of(members_->members, is_own)) return "";
  const std::string role(name(paths_.role));
  const std::string member = paths_.node.empty() ? "NAME" : paths_.node;
  return paths_.members.string() + ": no " + role + (paths_.node.empty() ? "" : " " + member) +
         " has the public key of " + paths_.signing_key.string() + "; try: v3dctl key enroll " +
         member + " --role " + role + " --public-key " + own.text();
}

bool CredentialFiles::is_ready() const {
  if (!key_) return false;
  return paths_.members.empty() || (members_ && (!signs_ || own_));
}

std::string CredentialFiles::problem() const {
  for (const std::string* problem :
       {&key_problem_, &members_problem_, &signing_problem_, &serial_problem_}) {
    if (!problem->empty()) return *problem;
  }
  return not_member_;
}

namespace {

constexpr uint64_t kMaxBytes = 4096;

}  // namespace

AcceptedSerial::AcceptedSerial(std::filesystem::path path, std::string studio,
                               std::string authority)
    : path_(std::move(path)), studio_(std::move(studio)), authority_(std::move(authority)) {}

int64_t AcceptedSerial::load() const {
  if (path_.empty()) return 0;
  const auto text = io::read_file(path_, kMaxBytes, io::OpenMode::kReadWithinFolder);
  if (!text) {
    if (text.error().code == ENOENT) return 0;
    throw InputError(text.error().message);
  }
  const TomlTable table = TomlTable::parse(*text, path_);
  if (table.text("studio") != studio_ || table.text("authority") != authority_) return 0;
  const int64_t serial = table.integer("serial");
  if (serial < 1) table.fail("serial", "expected 1 or more");
  return serial;
}

io::Status AcceptedSerial::save(int64_t serial) const {
  if (path_.empty()) return {};
  TomlWriter file;
  file.comment(
          "The newest member list that this node has accepted. It rejects lists with a lower "
          "serial.")
      .text("studio", studio_)
      .text("authority", authority_)
      .integer("serial", serial);
  return io::replace_file(path_, file.written());
}

}  // namespace v3d::bus
