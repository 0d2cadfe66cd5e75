#include "trigger/gpio_lines.h"

#include <charconv>

namespace v3d::trigger {

std::string line_text(const StudioLine& line) { return line.line + " of " + line.chip; }

std::optional<unsigned> number_of(const StudioLine& line) {
  const std::string& text = line.line;
  unsigned number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  const bool whole = error == std::errc() && end == text.data() + text.size();
  return whole ? std::optional(number) : std::nullopt;
}

}  // namespace v3d::trigger
