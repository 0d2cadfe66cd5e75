// The slate of a take that is joined of the parts of several nodes.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "base/io/file.h"
#include "take/take.h"
#include "take/take_listing.h"

namespace v3d::take {

/// The slate of a node.
using NodeSlate = std::pair<std::string, Slate>;

/// One slate with the text of all: the crew writes on each PC.
///
/// Scene, take number and note are those of the first slate that has one. The mark is circled when
/// a slate is circled, because a circled take is not deleted; otherwise rejected when one is. What
/// differs in a slate is added to the note, with the name of its node: "slips; cap02: take 4,
/// rejected, use the second attack".
Slate merged_slate(const std::vector<NodeSlate>& slates);

/// The fields of `slate` in one line that `copy` has neither as its own nor in its note, where
/// merged_slate() puts them: "take 4, use the second attack". Empty when it has all.
std::string text_not_in(const Slate& copy, const Slate& slate);

/// Writes the slate of the joined take `into`: none, when no part has one. The folder of a part has
/// the name of its node. A slate that cannot be read is copied unchanged when no other has text.
[[nodiscard]] io::Status join_slates(const std::vector<TakePaths>& parts, const TakePaths& into);

/// One line for each slate that cannot be read, and that the joined take `whole` does not have:
/// "cap02/slate.toml: is not copied: ...".
std::vector<std::string> slates_not_joined(const std::vector<TakePaths>& parts,
                                           const TakePaths& whole);

}  // namespace v3d::take
