#include "take/ledger/take_signature.h"

#include <algorithm>
#include <vector>

#include "base/config/toml_file.h"
#include "base/core/error.h"
#include "base/io/file.h"
#include "take/ledger/take_account.h"
#include "take/logs/file_hashes.h"
#include "take/take_removal.h"
#include "wire/signatures.h"

namespace v3d::take {
namespace {

namespace fs = std::filesystem;

constexpr int64_t kFormat = TakeSignature::kOccasionFormat;

void write_entry(const TakeFile& file, TomlWriter& text) {
  text.element("file").text("name", file.name).integer("bytes", file.bytes);
  if (file.root) text.text("root", wire::hash_text(*file.root));
}

void write_camera(const SignedCamera& camera, TomlWriter& text) {
  text.element("camera")
      .text("name", camera.name)
      .integer("exposed", camera.exposed)
      .integer("received", camera.received)
      .integer("written", camera.written)
      .integer("published", camera.published);
}

std::string text_of(const TakeSignature& signature) {
  TomlWriter text;
  text.integer("format", signature.format)
      .text("take", signature.take)
      .text("studio", signature.studio)
      .text("node", signature.node)
      .text("public_key", signature.key.text())
      .integer("started_ns", to_ns(signature.started), "since 1970, CLOCK_REALTIME")
      .integer("signed_ns", to_ns(signature.signed_at));
  if (signature.format >= TakeSignature::kOccasionFormat) {
    text.text("occasion", name(signature.occasion));
  }
  text.number("rate_hz", signature.rate_hz)
      .integer("pulses", signature.pulses)
      .text("state", name(signature.state));
  for (const TakeNode& node : signature.nodes) write_node("capture_node", node, text);
  for (const SignedCamera& camera : signature.cameras) write_camera(camera, text);
  for (const TakeFile& file : signature.files) write_entry(file, text);
  return text.written();
}

TakeFile read_entry(const TomlTable& table) {
  TakeFile file{.name = table.text("name"), .bytes = table.integer("bytes"), .checksum = {}};
  if (table.has("root")) {
    file.root = wire::parse_hash(table.text("root"));
    if (!file.root) table.fail("root", "expected 64 hexadecimal digits");
  }
  table.reject_unknown_fields();
  return file;
}

SignedCamera read_camera(const TomlTable& table) {
  SignedCamera camera{.name = table.text("name"),
                      .exposed = table.integer("exposed"),
                      .received = table.integer("received"),
                      .written = table.integer("written"),
                      .published = table.integer("published")};
  table.reject_unknown_fields();
  return camera;
}

int64_t read_format(const TomlTable& table) {
  const int64_t format = table.integer("format");
  if (format < 1 || format > kFormat) {
    table.fail("format", "expected 1 to " + std::to_string(kFormat) + "; a newer version wrote it");
  }
  return format;
}

SigningOccasion read_occasion(const TomlTable& table, int64_t format) {
  if (format < TakeSignature::kOccasionFormat) return SigningOccasion::kUnknown;
  const std::string text = table.text("occasion");
  for (const SigningOccasion occasion :
       {SigningOccasion::kStop, SigningOccasion::kRecovery, SigningOccasion::kCommand}) {
    if (text == name(occasion)) return occasion;
  }
  table.fail("occasion", "expected stop, recovery or command, found '" + text + "'");
}

TakeState read_state(const TomlTable& table) {
  const std::string text = table.text("state");
  for (const TakeState state : {TakeState::kComplete, TakeState::kRecovered}) {
    if (text == name(state)) return state;
  }
  table.fail("state", "expected complete or recovered, found '" + text + "'");
}

/// How files without a known root are signed.
struct Reading {
  bool reads_camera_logs = true;  ///< false: their lengths are signed
  MayContinue may_continue = {};
};

io::Result<TakeFile> signed_file(const TakePaths& paths, const TakeInfo& info,
                                 const std::string& name, const TakeFile* known,
                                 const Reading& reading) {
  if (known != nullptr && known->root) return *known;
  auto now = stat_take_file(paths, name);
  if (!now || (!reading.reads_camera_logs && is_camera_log(name, info))) return now;
  return hash_take_file(paths, name, now->bytes, reading.may_continue);
}

/// The counts of the ledger, which the node has just written or an operator signs for it.
std::vector<SignedCamera> camera_counts(const TakePaths& paths) {
  std::vector<SignedCamera> cameras;
  for (const CameraLedger& camera : load_ledger(paths.ledger()).cameras) {
    cameras.push_back(signed_counts(camera));
  }
  return cameras;
}

/// All but the files. Throws InputError when take.toml, studio.toml or the ledger cannot be read.
TakeSignature signature_of(const TakePaths& paths, const TakeInfo& info, const TakeSigner& signer,
                           SigningOccasion occasion) {
  return {.take = info.name,
          .studio = info.studio,
          .node = signer.node,
          .key = signer.key.public_key(),
          .started = info.started,
          .signed_at = Realtime::now(),
          .occasion = occasion,
          .rate_hz = info.rate_hz,
          .pulses = info.pulses,
          .state = info.state,
          .nodes = capture_nodes(paths),
          .cameras = camera_counts(paths),
          .files = {}};
}

io::Result<TakeSignature> make_or_throw(const TakePaths& paths, const TakeSigner& signer,
                                        SigningOccasion occasion,
                                        const std::vector<TakeFile>& known,
                                        const Reading& reading) {
  const TakeInfo info = load_take_info(paths);
  TakeSignature signature = signature_of(paths, info, signer, occasion);
  const auto names = take_file_names(paths);
  if (!names) return tl::make_unexpected(names.error());
  for (const std::string& name : *names) {
    if (!is_signed_file(name)) continue;
    const auto found = std::ranges::find(known, name, &TakeFile::name);
    auto file = signed_file(paths, info, name, found == known.end() ? nullptr : &*found, reading);
    if (!file) return tl::make_unexpected(file.error());
    signature.files.push_back(*std::move(file));
  }
  return signature;
}

io::Result<TakeSignature> make_signature(const TakePaths& paths, const TakeSigner& signer,
                                         SigningOccasion occasion,
                                         const std::vector<TakeFile>& known,
                                         const Reading& reading) {
  try {
    return make_or_throw(paths, signer, occasion, known, reading);
  } catch (const InputError& error) {
    return io::io_error("sign", paths.folder, error.what());
  }
}

io::Status save_if_made(const TakePaths& paths, const io::Result<TakeSignature>& signature,
                        const TakeSigner& signer) {
  if (!signature) return tl::make_unexpected(signature.error());
  return save_signature(paths, *signature, signer.key);
}

}  // namespace

std::string_view name(SigningOccasion occasion) {
  switch (occasion) {
    case SigningOccasion::kStop:
      return "stop";
    case SigningOccasion::kRecovery:
      return "recovery";
    case SigningOccasion::kCommand:
      return "command";
    case SigningOccasion::kUnknown:
      break;
  }
  return "unknown";
}

SignedCamera signed_counts(const CameraLedger& camera) {
  return {.name = camera.name,
          .exposed = camera.exposed,
          .received = camera.received,
          .written = camera.written,
          .published = camera.published};
}

fs::path signature_path(const TakePaths& paths, const std::string& node) {
  return paths.folder / ("signature." + node + ".toml");
}

namespace {

fs::path hidden_signature(const TakePaths& paths, const std::string& node) {
  return paths.folder / (".before-rejoin." + signature_path(paths, node).filename().string());
}

}  // namespace

io::Result<bool> set_signature_aside(const TakePaths& paths, const std::string& node) {
  const fs::path signature = signature_path(paths, node);
  const auto type = io::type_of(signature);
  if (!type) return tl::make_unexpected(type.error());
  if (*type == fs::file_type::not_found) return false;
  remove_working_file(hidden_signature(paths, node));
  return io::rename_new(signature, hidden_signature(paths, node)).map([] { return true; });
}

io::Status restore_signature(const TakePaths& paths, const std::string& node) {
  return io::rename_new(hidden_signature(paths, node), signature_path(paths, node));
}

bool is_signed_file(std::string_view name) {
  return !is_written_after_ledger(name) && name != TakePaths().info();
}

io::Status save_signature(const TakePaths& paths, const TakeSignature& signature,
                          const wire::SigningKey& key) {
  return io::replace_file(signature_path(paths, signature.node),
                          sign_text(text_of(signature), key));
}

io::Status sign_take(const TakePaths& paths, const TakeSigner& signer,
                     const std::vector<TakeFile>& files, const MayContinue& may_continue) {
  return save_if_made(paths,
                      make_signature(paths, signer, SigningOccasion::kStop, files,
                                     {.reads_camera_logs = false, .may_continue = may_continue}),
                      signer);
}

io::Result<TakeSignature> read_signature(const TakePaths& paths, const TakeSigner& signer,
                                         SigningOccasion occasion,
                                         const MayContinue& may_continue) {
  return make_signature(paths, signer, occasion, {}, {.may_continue = may_continue});
}

io::Status sign_whole_take(const TakePaths& paths, const TakeSigner& signer,
                           SigningOccasion occasion) {
  return save_if_made(paths, read_signature(paths, signer, occasion), signer);
}

TakeSignature parse_signature(std::string_view text, const fs::path& path) {
  const wire::SignedText signed_text = wire::split_signed_text(text, path);
  const TomlTable table = TomlTable::parse(signed_text.text, path);
  const int64_t format = read_format(table);
  TakeSignature read{.format = format,
                     .take = table.text("take"),
                     .studio = table.text("studio"),
                     .node = table.text("node"),
                     .key = wire::PublicKey::parse(table.text("public_key"), path.string()),
                     .started = from_ns<Realtime>(table.integer("started_ns")),
                     .signed_at = from_ns<Realtime>(table.integer("signed_ns")),
                     .occasion = read_occasion(table, format),
                     .rate_hz = table.number("rate_hz"),
                     .pulses = table.integer("pulses"),
                     .state = read_state(table),
                     .nodes = {},
                     .cameras = {},
                     .files = {}};
  if (read.names_nodes()) {
    read.nodes = read_nodes(table, "capture_node");
    for (const TomlTable& camera : table.tables("camera")) {
      read.cameras.push_back(read_camera(camera));
    }
  }
  for (const TomlTable& file : table.tables("file")) read.files.push_back(read_entry(file));
  table.reject_unknown_fields();
  if (!signed_text.is_signed_by(read.key)) {
    throw InputError(path.string() + ": its signature is wrong: the file was changed");
  }
  return read;
}

io::Result<TakeFile> hash_take_file(const TakePaths& paths, const std::string& name, int64_t bytes,
                                    const MayContinue& may_continue) {
  const auto file = io::File::open(paths.folder / name, io::OpenMode::kReadWithinFolder);
  if (!file) return tl::make_unexpected(file.error());
  const auto size = file->size();
  if (!size) return tl::make_unexpected(size.error());
  TakeFile hashed{.name = name, .bytes = static_cast<int64_t>(*size), .checksum = {}};
  if (hashed.bytes != bytes) return hashed;
  wire::HashTree tree;
  const io::Status added = add_to_tree(*file, {.begin = 0, .end = *size}, tree, may_continue);
  if (!added) return tl::make_unexpected(added.error());
  hashed.root = tree.root();
  return hashed;
}

}  // namespace v3d::take
