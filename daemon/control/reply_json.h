// JSON of reply details and take lists. Confines nlohmann::json to one source file.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "take/ledger/ledger.h"
#include "take/take_listing.h"

namespace v3d::control {

/// A ledger with the keys of `v3dctl verify --json`: take, complete, pulses {commanded, sensed
/// (null without a sense line), unsensed [..], extra, runt [..]}, cameras [...]; for a copy without
/// all nodes, absent_nodes [{name, cameras}].
std::string ledger_json(const take::Ledger& ledger);
/// The list that `v3dctl takes --json` prints and v3d-viewd serves: {"takes": [{name, studio,
/// started_ns, state, verified, rate_hz, pulses, seconds, bytes, mesh_bytes, proxy_bytes (0 without
/// proxy.v3d), cameras, meshes, slate {scene, take, note, mark}}]}. Where the timecode is known,
/// timecode is "10:00:00:00 to 10:01:00:00", of the first and the last pulse. Where mesh.v3d cannot
/// be read, meshes is null and mesh_error has the cause; where another file cannot be read, error
/// has the cause (TakeListing::error; v3dctl takes lists no such take); for a copy without all
/// nodes, absent_nodes is as in ledger_json(). Bytes that are not UTF-8 are replaced. `indent`: see
/// nlohmann::json::dump().
std::string takes_json(const std::vector<take::TakeListing>& takes, int indent = -1);
std::string numbers_json(const std::map<std::string, double>& values);

// Details of replies. The channel of replies drops a message of more than 4 MiB, and a take of
// hours can have millions of missing pulses.

/// Lists of more numbers than this, all lists of a reply together, are packed (pack_numbers()). A
/// version without packed lists rejects the reply with an error.
inline constexpr size_t kMaxListedNumbers = 100'000;
/// A ledger that is longer than this, although its lists are packed, is not sent.
inline constexpr size_t kMaxDetailBytes = 3 << 20;

/// As ledger_json(), with strings in place of its lists of pulses where these are long. Without
/// pulses and cameras where it would be longer than kMaxDetailBytes; readers then report the ledger
/// as unreadable.
std::string ledger_detail(const take::Ledger& ledger);
/// The result of a reconstruction node in a shared take: its numbers, and the pulses without a mesh
/// as `without_mesh` [..], packed where they are many.
std::string recon_json(const std::map<std::string, double>& values,
                       const std::vector<int64_t>& without_mesh);

// Packed text of long lists of pulse numbers, for replies: the channel of replies limits their
// length.

/// Packs numbers without loss, in the shorter one of two forms: runs of consecutive numbers,
/// "0:215999 300000" (first and last number of a run; one number alone), or a bit for each number
/// of a range, "bits 17 <base64>" (its first number; the lowest bit of a byte is first).
///
/// Ascending numbers of a range of n take at most n / 6 + 30 characters. Any order is permitted,
/// but then only runs are written.
std::string pack_numbers(const std::vector<int64_t>& numbers);

/// The numbers of a packed text. Empty for another text, and when there are more than `limit`
/// numbers: a short text can name any number of them.
std::optional<std::vector<int64_t>> unpack_numbers(std::string_view text, size_t limit);

}  // namespace v3d::control
