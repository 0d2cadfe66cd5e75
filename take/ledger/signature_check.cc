#include "take/ledger/signature_check.h"

#include <algorithm>
#include <map>
#include <optional>
#include <set>

#include "base/core/error.h"
#include "base/io/file.h"
#include "take/ledger/ledger.h"
#include "take/ledger/take_signature.h"

namespace v3d::take {
namespace {

constexpr uint64_t kMaxSignatureBytes = 16 << 20;

/// The node of a file signature.<node>.toml.
std::string node_of(std::string_view name) {
  name.remove_prefix(std::string_view("signature.").size());
  name.remove_suffix(std::string_view(".toml").size());
  return std::string(name);
}

/// The first digits of a key, for messages.
std::string short_text(const std::string& key) { return key.substr(0, 16) + "..."; }

class Check {
 public:
  Check(const TakePaths& paths, const Studio* studio)
      : paths_(paths), studio_(studio), info_(load_take_info(paths)) {}

  SignatureCheck run() {
    auto names = take_file_names(paths_);
    if (!names) {
      result_.disagreements.push_back(names.error().message);
      return std::move(result_);
    }
    names_ = *std::move(names);
    for (const std::string& name : names_) {
      if (is_signature(name)) read(name);
    }
    for (const auto& [name, entries] : signed_) {
      if (is_signed_file(name)) check_file(name, entries);  // earlier versions signed skeletons
    }
    check_pulses();
    check_facts();
    if (!signatures_.empty()) note_unsigned();
    result_.is_complete = check_nodes() && is_covered();
    return std::move(result_);
  }

 private:
  struct Entry {
    size_t signer;  ///< index into signatures_ and result_.signers
    TakeFile file;
  };

  void read(const std::string& name) {
    const auto text =
        io::read_file(paths_.folder / name, kMaxSignatureBytes, io::OpenMode::kReadWithinFolder);
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
    // Start times are not compared, because each node of a take has its own.
    if (signature.take != info_.name || signature.studio != info_.studio) {
      return disagree(name, "is of another take, " + signature.take + " of " + signature.studio);
    }
    if (signature.rate_hz != info_.rate_hz) {
      return disagree(name, "has another pulse rate than take.toml");
    }
    const std::string trusted = key_of(signature.node), key = signature.key.text();
    if (!trusted.empty() && trusted != key) {
      return disagree(name, "was made with the key " + short_text(key) + ", the studio file has " +
                                short_text(trusted) + " for " + signature.node);
    }
    if (trusted.empty()) {
      result_.notes.push_back(name + ": was made with the key " + key +
                              ", which the studio file does not list");
    }
    if (!signature.names_nodes()) {
      result_.notes.push_back(name +
                              ": has format 1, which does not name the nodes of the take; to sign "
                              "them too: v3dctl takes sign");
    }
    for (const TakeFile& file : signature.files) {
      signed_[file.name].push_back({signatures_.size(), file});
    }
    result_.signers.push_back({.node = signature.node,
                               .key = signature.key,
                               .is_known = !trusted.empty(),
                               .signed_at = signature.signed_at,
                               .occasion = signature.occasion});
    signatures_.push_back(std::move(signature));
  }

  bool is_known(const Entry& entry) const { return result_.signers[entry.signer].is_known; }
  const std::string& node(const Entry& entry) const { return signatures_[entry.signer].node; }

  /// Compares a file with the signatures that cover it. Signatures with known keys take precedence,
  /// then those of the node that owns the camera. Several may remain: each part of a joined take
  /// has a pulse log, and the joined take has one of them.
  void check_file(const std::string& name, std::vector<Entry> entries) {
    keep_only_if_any(entries, [&](const Entry& e) { return is_known(e); });
    const std::string owner = owner_of(name);
    keep_only_if_any(entries, [&](const Entry& e) { return node(e) == owner; });
    const std::string& signer = node(entries.front());
    // The name comes from a file of unknown origin, so only files of the take are read.
    if (!std::ranges::binary_search(names_, name)) {
      return disagree(name, "missing; the signature of " + signer + " names it");
    }
    const auto now = stat_take_file(paths_, name);
    if (!now) return result_.disagreements.push_back(now.error().message);
    // A file of another length is not read, because its length is unlimited.
    std::erase_if(entries, [&](const Entry& e) { return e.file.bytes != now->bytes; });
    if (std::ranges::any_of(entries, [](const Entry& e) { return e.file.root.has_value(); })) {
      const auto hashed = hash_take_file(paths_, name, now->bytes);
      if (!hashed) return result_.disagreements.push_back(hashed.error().message);
      std::erase_if(entries, [&](const Entry& e) { return e.file.root != hashed->root; });
    }
    if (entries.empty()) return disagree(name, "does not match the signature of " + signer);
    accept(name, owner, entries.front());
  }

  template <class Condition>
  static void keep_only_if_any(std::vector<Entry>& entries, Condition condition) {
    if (std::ranges::none_of(entries, condition)) return;
    std::erase_if(entries, [&](const Entry& e) { return !condition(e); });
  }

  void accept(const std::string& name, const std::string& owner, const Entry& entry) {
    if (!owner.empty() && owner != node(entry)) {
      return disagree(name,
                      "was signed by " + node(entry) + ", but its camera belongs to " + owner);
    }
    if (!entry.file.root) {
      result_.notes.push_back(
          name + ": only its length is signed by " + node(entry) +
          ", because the daemon restarted in the take; to sign its content: v3dctl takes sign");
      return;
    }
    ++result_.signers[entry.signer].files;
    if (is_known(entry)) covered_.insert(name);
  }

  /// Compares the number of pulses with the highest number in the signatures: a node may know fewer
  /// pulses than the take has, never more.
  void check_pulses() {
    int64_t max_pulses = 0;
    for (const TakeSignature& signature : signatures_)
      max_pulses = std::max(max_pulses, signature.pulses);
    if (signatures_.empty() || max_pulses == info_.pulses) return;
    disagree(paths_.info().filename(), "has " + std::to_string(info_.pulses) +
                                           " pulses, the signatures have " +
                                           std::to_string(max_pulses));
  }

  /// Indexes of the signatures with known keys; of all signatures when no key is known.
  std::vector<size_t> trusted_signatures() const {
    std::vector<size_t> known, all;
    for (size_t i = 0; i < signatures_.size(); ++i) {
      all.push_back(i);
      if (result_.signers[i].is_known) known.push_back(i);
    }
    return known.empty() ? all : known;
  }

  /// Compares nodes, cameras and counts of frames, which take.toml and the ledger contain unsigned.
  void check_facts() {
    const std::optional<Ledger> ledger = stored_ledger();
    const TakeSignature* first = nullptr;
    for (const size_t i : trusted_signatures()) {
      const TakeSignature& signature = signatures_[i];
      if (!signature.names_nodes()) continue;
      if (first == nullptr) first = &signature;
      if (signature.nodes != first->nodes) {
        disagree(signature_name(signature),
                 "names other nodes of the take than " + signature_name(*first) + " does");
      }
      if (signature.state == TakeState::kRecovered && info_.state == TakeState::kComplete) {
        disagree("take.toml", "says complete, " + signature_name(signature) + " recovered");
      }
      for (const SignedCamera& camera : signature.cameras) {
        check_camera(signature_name(signature), camera, ledger);
      }
    }
  }

  void check_camera(const std::string& signature, const SignedCamera& camera,
                    const std::optional<Ledger>& ledger) {
    if (std::ranges::find(info_.cameras, camera.name) == info_.cameras.end()) {
      return disagree("take.toml",
                      "has no camera " + camera.name + ", which " + signature + " names");
    }
    if (!ledger) return;
    const auto found = std::ranges::find(ledger->cameras, camera.name, &CameraLedger::name);
    if (found == ledger->cameras.end() || signed_counts(*found) != camera) {
      disagree("ledger.toml",
               "its counts of frames of " + camera.name + " are not those of " + signature);
    }
  }

  /// Empty when it cannot be read, which the verification of the take reports.
  std::optional<Ledger> stored_ledger() const {
    try {
      return load_ledger(paths_.ledger());
    } catch (const InputError&) {
      return std::nullopt;
    }
  }

  static std::string signature_name(const TakeSignature& signature) {
    return signature_path({}, signature.node).filename();
  }

  void note_unsigned() {
    std::string list;
    for (const std::string& name : names_) {
      if (is_signed_file(name) && !signed_.contains(name))
        list += (list.empty() ? "" : ", ") + name;
    }
    if (!list.empty()) result_.notes.push_back("without a signature: " + list);
  }

  /// True when a signature with a known key names the nodes of the take.
  bool nodes_are_named() const {
    return std::ranges::any_of(trusted_signatures(), [&](size_t i) {
      return result_.signers[i].is_known && signatures_[i].names_nodes();
    });
  }

  /// The nodes that must have signed: those that a signature with a known key names, and those of
  /// the cameras in take.toml.
  std::set<std::string> required_nodes() const {
    std::set<std::string> nodes;
    for (const std::string& camera : info_.cameras) nodes.insert(node_with(camera));
    for (const size_t i : trusted_signatures()) {
      if (!result_.signers[i].is_known) continue;
      for (const TakeNode& node : signatures_[i].nodes) nodes.insert(node.name);
    }
    nodes.erase("");  // of a camera that the studio file does not list
    return nodes;
  }

  /// True when every node of the take has signed with a known key.
  bool check_nodes() {
    bool all = nodes_are_named();
    for (const std::string& node : required_nodes()) {
      const auto signer = std::ranges::find(result_.signers, node, &SignedBy::node);
      if (signer != result_.signers.end() && signer->is_known) continue;
      all = false;
      if (!key_of(node).empty()) {
        result_.notes.push_back("no signature of " + node +
                                ", for which the studio file has a key");
      }
    }
    return all;
  }

  bool is_covered() const {
    return std::ranges::all_of(names_, [&](const std::string& name) {
      return !is_signed_file(name) || covered_.contains(name);
    });
  }

  /// The node of the camera that the log or plate belongs to: "cam01.0001.lcmlog",
  /// "background/cam01.toml". Empty when it belongs to no camera, or when the studio file does not
  /// list the camera.
  std::string owner_of(std::string_view name) const {
    constexpr std::string_view kPlates = "background/";
    if (name.starts_with(kPlates)) name.remove_prefix(kPlates.size());
    const std::string* owner = nullptr;  // the longest name: of "ring.01", not of "ring"
    for (const std::string& camera : info_.cameras) {
      const bool is_longer = owner == nullptr || camera.size() > owner->size();
      if (is_longer && name.starts_with(camera + ".")) owner = &camera;
    }
    return owner == nullptr ? "" : node_with(*owner);
  }

  std::string node_with(const std::string& camera) const {
    if (studio_ == nullptr) return "";
    const auto found = std::ranges::find(studio_->cameras, camera, &StudioCamera::name);
    return found == studio_->cameras.end() ? "" : found->node;
  }

  std::string key_of(const std::string& node) const {
    if (studio_ == nullptr) return "";
    const auto found = std::ranges::find(studio_->nodes, node, &StudioNode::name);
    return found == studio_->nodes.end() ? "" : found->public_key;
  }

  void disagree(const std::string& name, const std::string& what) {
    result_.disagreements.push_back(name + ": " + what);
  }

  const TakePaths& paths_;
  const Studio* const studio_;
  const TakeInfo info_;
  std::vector<std::string> names_;  ///< sorted names of the files of the take
  std::vector<TakeSignature> signatures_;
  std::map<std::string, std::vector<Entry>> signed_;
  std::set<std::string> covered_;  ///< files whose root matches a signature with a known key
  SignatureCheck result_;
};

}  // namespace

SignatureCheck check_signatures(const TakePaths& paths, const Studio* studio) {
  return Check(paths, studio).run();
}

}  // namespace v3d::take
