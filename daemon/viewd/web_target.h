// What stands behind GET: a path in segments and a query, both decoded. Pure; the bytes are
// hostile.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace v3d {

struct WebTarget {
  std::vector<std::string> path;  ///< "/takes/kendo-07" is {"takes", "kendo-07"}; "/" is empty
  std::map<std::string, std::string> query;

  /// "/takes/kendo-07"
  std::string text() const;
};

/// Percent-encoding (RFC 3986) is undone once. Empty for whatever no page of ours asks for: more
/// than 2048 bytes, no '/' in front, a segment that is empty, "." or "..", and any byte that,
/// decoded, is no printable ASCII, a '/' or a '\'.
std::optional<WebTarget> parse_web_target(std::string_view target);

}  // namespace v3d
