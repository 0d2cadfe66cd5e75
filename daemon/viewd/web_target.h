// The target of an HTTP request: decoded path segments and query. Safe for hostile input.
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

/// Decodes percent-encoding (RFC 3986) once. Empty for a target of more than 2048 bytes, without
/// leading '/', with a segment that is empty, "." or "..", or with a decoded byte that is '/', '\'
/// or not printable ASCII.
std::optional<WebTarget> parse_web_target(std::string_view target);

}  // namespace v3d
