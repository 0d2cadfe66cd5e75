#include "take/take_signature.h"

#include <algorithm>
#include <cstring>
#include <map>
#include <optional>
#include <set>

#include "base/error.h"
#include "base/io/big_endian.h"
#include "base/io/file.h"
#include "base/toml_file.h"
#include "take/event_log.h"
#include "wire/hexadecimal.h"

namespace v3d {
namespace {

namespace fs = std::filesystem;

constexpr int kFormat = 1;
constexpr std::string_view kFirstLine = "signature = ";
constexpr std::string_view kPrefix = "signature.", kExtension = ".toml";
constexpr uint64_t kBlock = 1 << 20;
constexpr uint32_t kMaxChannelBytes = 256;

std::span<const uint8_t> bytes_of(std::string_view text) {
  return {reinterpret_cast<const uint8_t*>(text.data()), text.size()};
}

fs::path signature_path(const TakePaths& paths, const std::string& node) {
  return paths.folder / (std::string(kPrefix) + node + std::string(kExtension));
}

/// Of signature.<node>.toml; empty for another name.
std::string node_of(std::string_view name) {
  if (!is_signature(name)) return "";
  name.remove_prefix(kPrefix.size());
  name.remove_suffix(kExtension.size());
  return std::string(name);
}

// --- trees
// ------------------------------------------------------------------------------------------

class FileTree {
 public:
  FileTree(const io::File& file, uint64_t size, bool is_log)
      : file_(file), size_(size), is_log_(is_log) {}

  io::Result<Hash> root() {
    HashTree tree;
    for (uint64_t at = 0; at < size_;) {
      const auto length = leaf_length(at);
      if (!length) return tl::make_unexpected(length.error());
      const auto leaf = hash(at, *length);
      if (!leaf) return tl::make_unexpected(leaf.error());
      tree.add(*leaf);
      at += *length;
    }
    return tree.root();
  }

 private:
  io::Result<uint64_t> leaf_length(uint64_t at) {
    const uint64_t block = std::min(kBlock, size_ - at);
    if (!is_log_ || block < kEventHeaderSize) return block;
    const auto got = file_.read(at, std::span(chunk_).first(kEventHeaderSize));
    if (!got) return tl::make_unexpected(got.error());
    const auto number = [&](size_t offset) {
      return read_big_endian(std::span(chunk_).subspan(offset, 4));
    };
    if (*got < kEventHeaderSize || number(0) != kEventSyncWord) return block;
    const uint64_t channel = number(20), data = number(24);
    const uint64_t event = kEventHeaderSize + channel + data;
    const bool is_event =
        channel <= kMaxChannelBytes && data <= kMaxEventBytes && event <= size_ - at;
    return is_event ? event : block;
  }

  io::Result<Hash> hash(uint64_t at, uint64_t length) {
    LeafHash leaf;
    for (const uint64_t end = at + length; at < end;) {
      const auto got = file_.read(at, std::span(chunk_).first(std::min(kBlock, end - at)));
      if (!got) return tl::make_unexpected(got.error());
      if (*got == 0) return io::io_error("read", file_.path(), "it has become shorter", EIO);
      leaf.add(std::span(chunk_).first(*got));
      at += *got;
    }
    return leaf.value();
  }

  const io::File& file_;
  const uint64_t size_;
  const bool is_log_;
  std::vector<uint8_t> chunk_ = std::vector<uint8_t>(kBlock);
};

// --- text
// -------------------------------------------------------------------------------------------

std::string text_of(const TakeFile& file) {
  std::string text = "\n[[file]]\nname = " + toml_string(file.name) +
                     "\nbytes = " + std::to_string(file.bytes) + "\n";
  if (file.root) text += "root = " + toml_string(hash_text(*file.root)) + "\n";
  return text;
}

std::string signed_text(const TakeSignature& signature) {
  std::string text =
      "format = " + std::to_string(kFormat) + "\ntake = " + toml_string(signature.take) +
      "\nstudio = " + toml_string(signature.studio) + "\nnode = " + toml_string(signature.node) +
      "\npublic_key = " + toml_string(signature.key.text()) +
      "\nstarted_ns = " + std::to_string(to_ns(signature.started)) +
      "  # since 1970, CLOCK_REALTIME\nsigned_ns = " + std::to_string(to_ns(signature.signed_at)) +
      "\nrate_hz = " + toml_number(signature.rate_hz) +
      "\npulses = " + std::to_string(signature.pulses) +
      "\nstate = " + toml_string(std::string(name(signature.state))) + "\n";
  for (const TakeFile& file : signature.files) text += text_of(file);
  return text;
}

TakeFile read_entry(const TomlTable& table) {
  TakeFile file{.name = table.text("name"), .bytes = table.integer("bytes"), .checksum = {}};
  if (table.has("root")) {
    file.root = parse_hash(table.text("root"));
    if (!file.root) table.fail("root", "expected 64 hexadecimal digits");
  }
  table.refuse_unknown();
  return file;
}

TakeState read_state(const TomlTable& table) {
  const std::string text = table.text("state");
  for (const TakeState state : {TakeState::kComplete, TakeState::kRecovered}) {
    if (text == name(state)) return state;
  }
  table.fail("state", "expected complete or recovered, found '" + text + "'");
}

/// The signature on the first line, and the text behind that line.
std::pair<Signature, std::string_view> split(std::string_view text, const fs::path& path) {
  const size_t end = text.find('\n');
  Signature signature{};
  const bool begins = text.starts_with(kFirstLine) && end != std::string_view::npos;
  std::string_view digits = begins ? text.substr(kFirstLine.size(), end - kFirstLine.size()) : "";
  if (digits.size() >= 2 && digits.front() == '\'' && digits.back() == '\'') {
    digits = digits.substr(1, digits.size() - 2);
  }
  if (!begins || !parse_hexadecimal(digits, signature)) {
    throw InputError(path.string() + ":1: expected signature = and 128 hexadecimal digits");
  }
  return {signature, text.substr(end + 1)};
}

// --- signing
// ----------------------------------------------------------------------------------------

bool is_signed(const TakePaths& paths, std::string_view name) {
  return !is_written_after_ledger(name) && paths.info().filename() != name;
}

bool is_camera_log(const std::string& name, const TakeInfo& info) {
  return name.ends_with(".lcmlog") && std::ranges::any_of(info.cameras, [&](const auto& camera) {
           return name.starts_with(camera + ".");
         });
}

enum class CameraLogs : uint8_t { kKnownOnly, kRead };

io::Result<TakeFile> signed_file(const TakePaths& paths, const std::string& name,
                                 const TakeFile* known, bool may_read) {
  if (known != nullptr && known->root) return *known;
  auto now = stat_take_file(paths, name);
  if (!now || !may_read) return now;
  return hash_take_file(paths, name, now->bytes);
}

io::Status sign(const TakePaths& paths, const TakeSigner& signer,
                const std::vector<TakeFile>& known, CameraLogs logs) {
  const TakeInfo info = load_take_info(paths);
  TakeSignature signature{.take = info.name,
                          .studio = info.studio,
                          .node = signer.node,
                          .key = signer.key.public_key(),
                          .started = info.started,
                          .signed_at = Realtime::now(),
                          .rate_hz = info.rate_hz,
                          .pulses = info.pulses,
                          .state = info.state,
                          .files = {}};
  const auto names = take_file_names(paths);
  if (!names) return tl::make_unexpected(names.error());
  for (const std::string& name : *names) {
    if (!is_signed(paths, name)) continue;
    const auto found = std::ranges::find(known, name, &TakeFile::name);
    const bool may_read = logs == CameraLogs::kRead || !is_camera_log(name, info);
    auto file = signed_file(paths, name, found == known.end() ? nullptr : &*found, may_read);
    if (!file) return tl::make_unexpected(file.error());
    signature.files.push_back(*std::move(file));
  }
  const std::string text = signed_text(signature);
  const std::string first_line =
      std::string(kFirstLine) + toml_string(hexadecimal(signer.key.sign(bytes_of(text)))) + "\n";
  return io::replace_file(signature_path(paths, signer.node), first_line + text);
}

// --- checking
// ---------------------------------------------------------------------------------------

class Check {
 public:
  Check(const TakePaths& paths, const Studio* studio)
      : paths_(paths), studio_(studio), info_(load_take_info(paths)) {}

  SignatureCheck run() {
    const auto names = take_file_names(paths_);
    if (!names) {
      result_.disagreements.push_back(names.error().message);
      return std::move(result_);
    }
    for (const std::string& name : *names) {
      if (is_signature(name)) read(name);
    }
    for (const auto& [name, entries] : signed_) check_file(name, entries);
    if (!signatures_.empty()) note_unsigned(*names);
    check_nodes();
    return std::move(result_);
  }

 private:
  struct Entry {
    size_t signer;  ///< index into signatures_
    TakeFile file;
  };

  void read(const std::string& name) {
    const auto text =
        io::read_file(paths_.folder / name, kMaxBytes, io::OpenMode::kReadWithinFolder);
    if (!text) return result_.disagreements.push_back(text.error().message);
    try {
      add(name, parse_signature(*text, paths_.folder / name));
    } catch (const InputError& error) {
      result_.disagreements.emplace_back(error.what());
    }
  }

  void add(const std::string& name, TakeSignature signature) {
    if (signature.node != node_of(name)) {
      return disagree(name, "is the signature of node " + signature.node);
    }
    // The nodes of one take begin at times of their own.
    if (signature.take != info_.name || signature.studio != info_.studio) {
      return disagree(name, "is of another take, " + signature.take + " of " + signature.studio);
    }
    const std::string trusted = key_of(signature.node);
    const bool is_known = trusted == signature.key.text();
    if (!trusted.empty() && !is_known) {
      return disagree(name, "was made with the key " + short_text(signature.key.text()) +
                                ", the studio file has " + short_text(trusted) + " for " +
                                signature.node);
    }
    if (!is_known) {
      result_.notes.push_back(name + ": was made with the key " + signature.key.text() +
                              ", which no studio file names here");
    }
    for (const TakeFile& file : signature.files) {
      signed_[file.name].push_back({signatures_.size(), file});
    }
    result_.signers.push_back({.node = signature.node,
                               .key = signature.key,
                               .is_known = is_known,
                               .signed_at = signature.signed_at});
    signatures_.push_back(std::move(signature));
  }

  /// Parts of one take were recorded by several nodes: the pulses are those of one of them.
  void check_file(const std::string& name, const std::vector<Entry>& entries) {
    const std::string& first = signatures_[entries.front().signer].node;
    const auto now = stat_take_file(paths_, name);
    if (!now) return disagree(name, "cannot be read, and " + first + " signed it");
    std::optional<TakeFile> hashed;
    for (const Entry& entry : entries) {
      if (entry.file.bytes != now->bytes) continue;
      if (!entry.file.root) {
        result_.notes.push_back(name + ": " + first +
                                " signed its length only, as after a recovery");
        return;
      }
      if (!hashed) {
        const auto read = hash_take_file(paths_, name, now->bytes);
        if (!read) return result_.disagreements.push_back(read.error().message);
        hashed = *read;
      }
      if (hashed->root == entry.file.root) return accept(name, entry);
    }
    disagree(name, "is not what " + first + " signed");
  }

  void accept(const std::string& name, const Entry& entry) {
    const std::string& node = signatures_[entry.signer].node;
    const std::string owner = node_of_camera_log(name);
    if (!owner.empty() && owner != node) {
      return disagree(name, "was signed by " + node + ", but is of a camera of " + owner);
    }
    ++result_.signers[entry.signer].files;
  }

  void note_unsigned(const std::vector<std::string>& names) {
    std::string list;
    for (const std::string& name : names) {
      if (is_signed(paths_, name) && !signed_.contains(name))
        list += (list.empty() ? "" : ", ") + name;
    }
    if (!list.empty()) result_.notes.push_back("signed by nobody: " + list);
  }

  void check_nodes() {
    if (studio_ == nullptr) return;
    result_.by_all_nodes = true;
    for (const StudioNode& node : studio_->nodes) {
      if (!recorded_on(node.name)) continue;
      const auto signer = std::ranges::find(result_.signers, node.name, &SignedBy::node);
      if (signer != result_.signers.end() && signer->is_known) continue;
      result_.by_all_nodes = false;
      if (!node.public_key.empty() && signer == result_.signers.end()) {
        result_.notes.push_back("not signed by " + node.name + ", whose key the studio file has");
      }
    }
  }

  bool recorded_on(const std::string& node) const {
    return std::ranges::any_of(studio_->cameras, [&](const StudioCamera& camera) {
      return camera.node == node &&
             std::ranges::find(info_.cameras, camera.name) != info_.cameras.end();
    });
  }

  /// Empty where the studio does not tell.
  std::string node_of_camera_log(const std::string& name) const {
    if (studio_ == nullptr || !is_camera_log(name, info_)) return "";
    const std::string camera = name.substr(0, name.find('.'));
    const auto found = std::ranges::find(studio_->cameras, camera, &StudioCamera::name);
    return found == studio_->cameras.end() ? "" : found->node;
  }

  std::string key_of(const std::string& node) const {
    if (studio_ == nullptr) return "";
    const auto found = std::ranges::find(studio_->nodes, node, &StudioNode::name);
    return found == studio_->nodes.end() ? "" : found->public_key;
  }

  /// Enough to tell keys apart.
  static std::string short_text(const std::string& key) { return key.substr(0, 16) + "..."; }

  void disagree(const std::string& name, const std::string& what) {
    result_.disagreements.push_back(name + ": " + what);
  }

  static constexpr uint64_t kMaxBytes = 16 << 20;

  const TakePaths& paths_;
  const Studio* const studio_;
  const TakeInfo info_;
  std::vector<TakeSignature> signatures_;
  std::map<std::string, std::vector<Entry>> signed_;
  SignatureCheck result_;
};

}  // namespace

io::Result<TakeFile> hash_take_file(const TakePaths& paths, const std::string& name,
                                    int64_t bytes) {
  const auto file = io::File::open(paths.folder / name, io::OpenMode::kRead);
  if (!file) return tl::make_unexpected(file.error());
  const auto size = file->size();
  if (!size) return tl::make_unexpected(size.error());
  TakeFile hashed{.name = name, .bytes = static_cast<int64_t>(*size), .checksum = {}};
  if (hashed.bytes != bytes) return hashed;
  const auto root = FileTree(*file, *size, name.ends_with(".lcmlog")).root();
  if (!root) return tl::make_unexpected(root.error());
  hashed.root = *root;
  return hashed;
}

io::Status sign_take(const TakePaths& paths, const TakeSigner& signer,
                     const std::vector<TakeFile>& files) {
  return sign(paths, signer, files, CameraLogs::kKnownOnly);
}

io::Status sign_recovered_take(const TakePaths& paths, const TakeSigner& signer) {
  return sign(paths, signer, {}, CameraLogs::kRead);
}

TakeSignature parse_signature(std::string_view text, const fs::path& path) {
  const auto [signature, signed_part] = split(text, path);
  const TomlTable table = TomlTable::parse(signed_part, path);
  if (table.integer("format") != kFormat) {
    table.fail("format", "expected " + std::to_string(kFormat) + "; a newer version wrote it");
  }
  TakeSignature read{.take = table.text("take"),
                     .studio = table.text("studio"),
                     .node = table.text("node"),
                     .key = PublicKey::parse(table.text("public_key"), path.string()),
                     .started = from_ns<Realtime>(table.integer("started_ns")),
                     .signed_at = from_ns<Realtime>(table.integer("signed_ns")),
                     .rate_hz = table.number("rate_hz"),
                     .pulses = table.integer("pulses"),
                     .state = read_state(table),
                     .files = {}};
  for (const TomlTable& file : table.tables("file")) read.files.push_back(read_entry(file));
  table.refuse_unknown();
  if (!read.key.has_signed(bytes_of(signed_part), signature)) {
    throw InputError(path.string() + ": its signature is wrong: the file was changed");
  }
  return read;
}

SignatureCheck check_signatures(const TakePaths& paths, const Studio* studio) {
  return Check(paths, studio).run();
}

}  // namespace v3d
