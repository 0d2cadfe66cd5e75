// Lines of the kernel's GPIO chips. gpio_line.cc is the adapter of libgpiod 1.6, the only file that
// sees it.
#pragma once

#include <functional>
#include <memory>
#include <optional>

#include "base/config/studio_file.h"
#include "base/core/time.h"

namespace v3d {

/// A line that this process drives. One thread at a time.
class OutputLine {
 public:
  virtual ~OutputLine() = default;
  /// False when the line is gone, as with a chip that was unplugged.
  virtual bool set(bool active) = 0;
};

struct LineEdge {
  bool begins = true;   ///< from inactive to active
  MonotonicInstant at;  ///< as the kernel's interrupt handler stamped it
};

/// A line whose edges this process reads. One thread.
class InputLine {
 public:
  virtual ~InputLine() = default;
  /// The next edge, waiting until `deadline`. The kernel keeps 16 and drops what comes then.
  virtual std::optional<LineEdge> wait(MonotonicInstant deadline) = 0;
  /// True when the line gives no edges any more.
  virtual bool gone() const = 0;
};

/// "TRIGGER of gpiochip0", for messages.
std::string line_text(const StudioLine& line);

/// Take the line for this process until the object is destroyed; an output begins inactive. Throw
/// InputError when there is no such chip or line, when it is in use, or not permitted.
std::unique_ptr<OutputLine> open_output_line(const StudioLine& line);
std::unique_ptr<InputLine> open_input_line(const StudioLine& line);

using OpenOutputLine = std::function<std::unique_ptr<OutputLine>(const StudioLine&)>;
using OpenInputLine = std::function<std::unique_ptr<InputLine>(const StudioLine&)>;

}  // namespace v3d
