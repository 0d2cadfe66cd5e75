// Table of `v3dctl watch`: the state of a studio as coloured lines. Pure, except for the time zone.
#pragma once

#include <string>
#include <vector>

#include "v3dctl/operate/studio_monitor.h"

namespace v3d::ctl {

/// Urgency of a value, shown as a colour.
enum class Highlight { kNone, kWarning, kAlarm };

struct WatchLine {
  struct Part {
    std::string text;
    Highlight highlight = Highlight::kNone;
  };
  std::vector<Part> parts;

  /// `colours`: with the escape sequences of a terminal.
  std::string text(bool colours) const;
};

/// Summary, then a line for each node with its cameras below, then the last events. The result has
/// at most `height` lines of at most `width` columns: events are dropped first, then cameras
/// without a fault.
std::vector<WatchLine> watch_lines(const StudioState& state, size_t width, size_t height);

/// "14:03:11  cap01  cam07: lost ...", local time.
WatchLine event_line(const wire::EventMessage& event);

/// State and progress of the take: "recording kendo-07   300 pulses   15/15 cameras ...".
std::string summary_line(const StudioState& state);

}  // namespace v3d::ctl
