// GPIO lines: outputs and inputs. gpio_lines_1.cc implements them with libgpiod 1.6,
// gpio_lines_2.cc with libgpiod 2; CMake compiles the one for the library that is installed.
#pragma once

#include <charconv>
#include <memory>
#include <optional>
#include <string>
#include <system_error>

#include "base/config/studio_file.h"
#include "base/core/time.h"

namespace v3d::trigger {

/// A line that this process drives. Threads: one caller at a time.
class OutputLine {
 public:
  virtual ~OutputLine() = default;
  /// Returns false where the line does not work any more, for example because its chip was
  /// unplugged.
  virtual bool set(bool active) = 0;
};

struct LineEdge {
  bool active = true;   ///< level after the edge
  MonotonicInstant at;  ///< time stamp of the kernel's interrupt handler
};

/// A line whose edges this process reads. Threads: one.
class InputLine {
 public:
  virtual ~InputLine() = default;
  /// Waits for the next edge until `deadline`; empty when none came. The kernel keeps 16 edges and
  /// drops further ones.
  virtual std::optional<LineEdge> wait(MonotonicInstant deadline) = 0;
  /// Whether the line does not work any more.
  virtual bool gone() const = 0;
};

/// "TRIGGER of gpiochip0", for messages.
inline std::string line_text(const StudioLine& line) { return line.line + " of " + line.chip; }

/// The number of a line on its chip, for a line that is given by its number; else empty.
inline std::optional<unsigned> number_of(const StudioLine& line) {
  const std::string& text = line.line;
  unsigned number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  const bool whole = error == std::errc() && end == text.data() + text.size();
  return whole ? std::optional(number) : std::nullopt;
}

/// Request a line for this process until the object is destroyed; an output starts inactive. Throw
/// InputError for an unknown chip or line, a line in use, and missing permission.
std::unique_ptr<OutputLine> open_output_line(const StudioLine& line);
std::unique_ptr<InputLine> open_input_line(const StudioLine& line);

}  // namespace v3d::trigger
