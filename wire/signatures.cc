#include "wire/signatures.h"

#include <sodium.h>

#include <algorithm>

#include "base/core/error.h"
#include "wire/secret_keys.h"

namespace v3d::wire {
namespace {

static_assert(crypto_sign_BYTES == kSignatureSize);
static_assert(crypto_sign_PUBLICKEYBYTES == sizeof(PublicKey::bytes));
static_assert(crypto_sign_SEEDBYTES == kKeySize);
static_assert(crypto_box_SEALBYTES == kSealSize);

using CurvePoint = std::array<uint8_t, crypto_box_PUBLICKEYBYTES>;

/// The X25519 form of a public key; empty when its bytes are no point of Ed25519.
std::optional<CurvePoint> curve_point(const PublicKey& key) {
  CurvePoint point{};
  const bool is_point = crypto_sign_ed25519_pk_to_curve25519(point.data(), key.bytes.data()) == 0;
  return is_point ? std::optional(point) : std::nullopt;
}

}  // namespace

const KeyKind kNodeKey{.name = "signing key",
                       .made_by = "v3dctl key node",
                       .remedy = "make one on each PC with v3dctl key node",
                       .remark =
                           "# The signing key of one V3D node, for its takes and messages. Do not "
                           "copy it to another PC.\n"};
const KeyKind kOperatorKey{
    .name = "operator key",
    .made_by = "v3dctl key operator",
    .remedy =
        "make it with v3dctl key operator, then add it to the member list with v3dctl key enroll",
    .remark = "# The key of one V3D operator. It signs commands.\n"};
const KeyKind kAuthorityKey{
    .name = "authority key",
    .made_by = "v3dctl key authority",
    .remedy = "give its file with --authority; make one with v3dctl key authority",
    .remark =
        "# The key of a V3D studio's authority: it signs the list of members. Do not store it "
        "on a PC of the studio.\n"};

bool PublicKey::has_signed(std::span<const uint8_t> message, const Signature& signature) const {
  return crypto_sign_verify_detached(signature.data(), message.data(), message.size(),
                                     bytes.data()) == 0;
}

bool PublicKey::seal(std::span<const uint8_t> secret, std::span<uint8_t> sealed) const {
  V3D_CHECK(sealed.size() == secret.size() + kSealSize);
  const auto point = curve_point(*this);
  return point && crypto_box_seal(sealed.data(), secret.data(), secret.size(), point->data()) == 0;
}

std::string PublicKey::text() const { return hexadecimal(bytes); }

std::optional<PublicKey> PublicKey::from_text(std::string_view text) {
  PublicKey key;
  if (!parse_hexadecimal(text, key.bytes)) return std::nullopt;
  return key;
}

PublicKey PublicKey::parse(std::string_view text, const std::string& where) {
  if (const auto key = from_text(text)) return *key;
  throw InputError(where +
                   ": expected a public key of 64 hexadecimal digits, as v3dctl key node "
                   "prints");
}

/// The key in the form of libsodium: seed and public key.
class SigningKey::Secret {
 public:
  explicit Secret(const SecretBuffer& seed) {
    crypto_sign_seed_keypair(public_.bytes.data(), bytes_.bytes().data(), seed.data());
  }

  const uint8_t* bytes() const { return bytes_.data(); }
  const PublicKey& public_key() const { return public_; }

 private:
  SecretBuffer bytes_{crypto_sign_SECRETKEYBYTES};
  PublicKey public_;
};

SigningKey::SigningKey(std::shared_ptr<const Secret> secret) : secret_(std::move(secret)) {}

SigningKey SigningKey::make() {
  SecretBuffer seed(kKeySize);
  randombytes_buf(seed.bytes().data(), seed.size());
  return from_seed(seed);
}

SigningKey SigningKey::load(const std::filesystem::path& path, const KeyKind& kind) {
  return from_seed(load_key_file(path, kind));
}

SigningKey SigningKey::from_seed(const SecretBuffer& seed) {
  return SigningKey(std::make_shared<const Secret>(seed));
}

void SigningKey::save(const std::filesystem::path& path, const char* group,
                      const KeyKind& kind) const {
  SecretBuffer seed(kKeySize);
  crypto_sign_ed25519_sk_to_seed(seed.bytes().data(), secret_->bytes());
  save_key_file(path, seed, kind, group);
}

PublicKey SigningKey::public_key() const { return secret_->public_key(); }

Signature SigningKey::sign(std::span<const uint8_t> message) const {
  Signature signature{};
  crypto_sign_detached(signature.data(), nullptr, message.data(), message.size(), secret_->bytes());
  return signature;
}

bool SigningKey::open_sealed(std::span<const uint8_t> sealed, std::span<uint8_t> secret) const {
  V3D_CHECK(sealed.size() == secret.size() + kSealSize);
  const auto point = curve_point(public_key());
  SecretBuffer scalar(crypto_box_SECRETKEYBYTES);
  crypto_sign_ed25519_sk_to_curve25519(scalar.bytes().data(), secret_->bytes());
  return point && crypto_box_seal_open(secret.data(), sealed.data(), sealed.size(), point->data(),
                                       scalar.data()) == 0;
}

namespace {

constexpr std::string_view kPrefix = "signature = '";
constexpr std::string_view kSuffix = "'\n";
constexpr size_t kDigits = 2 * kSignatureSize;

std::span<const uint8_t> bytes_of(std::string_view text) {
  return {reinterpret_cast<const uint8_t*>(text.data()), text.size()};
}

}  // namespace

bool SignedText::is_signed_by(const PublicKey& key) const {
  return key.has_signed(bytes_of(text), signature);
}

std::string sign_text(std::string_view text, const SigningKey& key) {
  std::string file(kPrefix);
  file += hexadecimal(key.sign(bytes_of(text)));
  file += kSuffix;
  return file += text;
}

SignedText split_signed_text(std::string_view file, const std::filesystem::path& path) {
  constexpr size_t kLine = kPrefix.size() + kDigits + kSuffix.size();
  SignedText split;
  const bool has_line = file.size() >= kLine && file.starts_with(kPrefix) &&
                        file.substr(kLine - kSuffix.size(), kSuffix.size()) == kSuffix;
  if (!has_line || !parse_hexadecimal(file.substr(kPrefix.size(), kDigits), split.signature)) {
    throw InputError(path.string() + ":1: expected signature = '<128 hexadecimal digits>'");
  }
  split.text = file.substr(kLine);
  return split;
}

namespace {

constexpr std::array<uint8_t, 4> kMagic = {'V', '3', 'D', 'S'};

void append_key_id(Bytes& message, const PublicKey& key) {
  const KeyId id = id_of(key);
  message.insert(message.end(), kMagic.begin(), kMagic.end());
  message.insert(message.end(), id.begin(), id.end());
}

/// Channel, zero byte, session, sequence and time.
Bytes bytes_of(const MessageOrigin& origin) {
  Bytes bytes(origin.channel.begin(), origin.channel.end());
  bytes.push_back(0);
  const auto put = [&](uint64_t number, int size) {
    for (int i = size - 1; i >= 0; --i) bytes.push_back(static_cast<uint8_t>(number >> 8 * i));
  };
  put(origin.session, 4);
  put(origin.sequence, 4);
  put(static_cast<uint64_t>(to_ns(origin.sent) / 1000), 8);
  return bytes;
}

}  // namespace

KeyId id_of(const PublicKey& key) {
  KeyId id{};
  std::copy_n(key.bytes.begin(), id.size(), id.begin());
  return id;
}

bool SignedMessage::is_signed_by(const PublicKey& key) const {
  return id_of(key) == key_id && key.has_signed(signed_bytes, signature);
}

Bytes sign_message(Bytes message, const SigningKey& key) {
  message.reserve(message.size() + kMessageSignatureSize);
  append_key_id(message, key.public_key());
  const Signature signature = key.sign(message);
  message.insert(message.end(), signature.begin(), signature.end());
  return message;
}

std::optional<SignedMessage> split_signature(std::span<const uint8_t> bytes) {
  if (bytes.size() <= kMessageSignatureSize) return std::nullopt;
  const size_t size = bytes.size() - kMessageSignatureSize;
  const auto magic = bytes.subspan(size, kMagic.size());
  if (!std::ranges::equal(magic, kMagic)) return std::nullopt;
  SignedMessage split;
  split.message = bytes.first(size);
  split.signed_bytes = bytes.first(bytes.size() - kSignatureSize);
  std::ranges::copy(split.signed_bytes.last(split.key_id.size()), split.key_id.begin());
  std::ranges::copy(bytes.last(kSignatureSize), split.signature.begin());
  return split;
}

BusStatement bus_statement(std::span<const uint8_t> signed_bytes, const MessageOrigin& origin) {
  LeafHash hash;
  hash.add(bytes_of(origin));
  hash.add(signed_bytes);
  BusStatement statement{};
  const auto end = std::ranges::copy(kBusText, statement.begin()).out;
  std::ranges::copy(hash.value(), end);
  return statement;
}

Bytes sign_on_bus(std::span<const uint8_t> message, const MessageOrigin& origin,
                  const SigningKey& key) {
  Bytes bytes;
  bytes.reserve(message.size() + kMessageSignatureSize);
  bytes.assign(message.begin(), message.end());
  append_key_id(bytes, key.public_key());
  const Signature signature = key.sign(bus_statement(bytes, origin));
  bytes.insert(bytes.end(), signature.begin(), signature.end());
  return bytes;
}

namespace {

constexpr std::array<uint8_t, 1> kLeaf{0}, kInner{1};

Hash parent_hash(const Hash& left, const Hash& right) {
  crypto_generichash_state state;
  crypto_generichash_init(&state, nullptr, 0, sizeof(Hash));
  crypto_generichash_update(&state, kInner.data(), kInner.size());
  crypto_generichash_update(&state, left.data(), left.size());
  crypto_generichash_update(&state, right.data(), right.size());
  Hash result{};
  crypto_generichash_final(&state, result.data(), result.size());
  return result;
}

}  // namespace

struct LeafHash::State {
  crypto_generichash_state blake2b;
};

LeafHash::LeafHash() : state_(std::make_unique<State>()) {
  crypto_generichash_init(&state_->blake2b, nullptr, 0, sizeof(Hash));
  add(kLeaf);
}
LeafHash::~LeafHash() = default;

void LeafHash::add(std::span<const uint8_t> part) {
  crypto_generichash_update(&state_->blake2b, part.data(), part.size());
}

Hash LeafHash::value() {
  Hash result{};
  crypto_generichash_final(&state_->blake2b, result.data(), result.size());
  return result;
}

void HashTree::add(const Hash& leaf) {
  subtrees_.push_back(leaf);
  // Each 1 bit at the low end of the count is one pair of full subtrees of equal size to merge.
  for (uint64_t n = leaves_++; (n & 1) != 0; n >>= 1) {
    const Hash right = subtrees_.back();
    subtrees_.pop_back();
    subtrees_.back() = parent_hash(subtrees_.back(), right);
  }
}

Hash HashTree::root() const {
  if (subtrees_.empty()) {
    Hash empty{};
    crypto_generichash(empty.data(), empty.size(), nullptr, 0, nullptr, 0);
    return empty;
  }
  Hash root = subtrees_.back();
  for (size_t i = subtrees_.size() - 1; i-- > 0;) root = parent_hash(subtrees_[i], root);
  return root;
}

std::string hash_text(const Hash& hash) { return hexadecimal(hash); }

std::optional<Hash> parse_hash(std::string_view text) {
  Hash hash{};
  if (!parse_hexadecimal(text, hash)) return std::nullopt;
  return hash;
}

}  // namespace v3d::wire
