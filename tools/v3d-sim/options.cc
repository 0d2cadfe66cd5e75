#include "v3d-sim/options.h"

#include <charconv>

#include "base/error.h"

namespace v3d::sim {

void add_studio_options(CLI::App& command, StudioOptions& options) {
  command.add_option("--cameras", options.cameras, "Number of cameras")
      ->check(CLI::Range(1, 200))
      ->capture_default_str();
  command.add_option("--size", options.size, "Image size in pixels, WIDTHxHEIGHT")
      ->capture_default_str();
  command.add_option("--seed", options.seed, "The same seed gives the same bytes")
      ->capture_default_str();
  command.add_option("--rate", options.rate_hz, "Pulses per second")
      ->check(CLI::Range(0.1, 1000.0))
      ->capture_default_str();
}

ImageSize parse_size(const std::string& text) {
  const auto side = [&](std::string_view digits) {
    int value = 0;
    const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
    const bool whole = error == std::errc{} && end == digits.data() + digits.size();
    if (!whole || value < 16 || value > 8192 || value % 2 != 0) {
      throw InputError("--size " + text +
                       ": expected WIDTHxHEIGHT, even numbers from 16 to 8192, e.g. 1024x768");
    }
    return value;
  };
  const size_t cross = std::min(text.find('x'), text.size());
  const std::string_view all = text;
  return {side(all.substr(0, cross)), side(cross < all.size() ? all.substr(cross + 1) : "")};
}

}  // namespace v3d::sim
