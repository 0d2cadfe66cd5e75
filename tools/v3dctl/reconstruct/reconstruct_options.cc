#include "v3dctl/reconstruct/reconstruct_options.h"

#include <charconv>
#include <string>

#include "base/error.h"
#include "v3dctl/options.h"

namespace v3d::ctl {
namespace {

[[noreturn]] void refuse(const std::string& part) {
  throw InputError("--deform " + part +
                   ": want NAME=VALUE of mode (search or paper), internal, photometric, "
                   "silhouette, window, views, hollows (0 or 1)");
}

template <class Number>
Number number_of(const std::string& value, const std::string& part) {
  Number number{};
  const char* end = value.data() + value.size();
  const auto [stop, error] = std::from_chars(value.data(), end, number);
  if (error != std::errc{} || stop != end) refuse(part);
  return number;
}

void set(DeformOptions& options, const std::string& part) {
  const size_t equals = part.find('=');
  if (equals == std::string::npos) refuse(part);
  const std::string name = part.substr(0, equals), value = part.substr(equals + 1);
  if (name == "mode" && value == "search") {
    options.mode = DeformMode::kSearch;
  } else if (name == "mode" && value == "paper") {
    options.mode = DeformMode::kPaper;
  } else if (name == "internal") {
    options.internal = number_of<double>(value, part);
  } else if (name == "photometric") {
    options.photometric = number_of<double>(value, part);
  } else if (name == "silhouette") {
    options.silhouette = number_of<double>(value, part);
  } else if (name == "window") {
    options.window = number_of<int>(value, part);
  } else if (name == "views") {
    options.views = number_of<int>(value, part);
  } else if (name == "hollows" && (value == "0" || value == "1")) {
    options.hollows = value == "1";
  } else {
    refuse(part);
  }
}

}  // namespace

DeformOptions parse_deform(std::string_view text) {
  DeformOptions options;
  for (const std::string& part : parse_names(text, "--deform")) set(options, part);
  check(options);
  return options;
}

}  // namespace v3d::ctl
