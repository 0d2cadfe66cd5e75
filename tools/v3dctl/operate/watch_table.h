// The table of v3dctl watch, made of what the nodes said. Pure but for the time zone.
#pragma once

#include <deque>
#include <map>
#include <string>
#include <vector>

#include "wire/messages.h"

namespace v3d::ctl {

/// What is known of the studio now.
struct StudioView {
  std::string studio;
  std::vector<std::string> nodes;                           ///< in the order of the studio file
  std::map<std::string, std::vector<std::string>> cameras;  ///< names by node
  std::map<std::string, HealthMessage> health;  ///< the last of each node; a silent one has none
  std::deque<EventMessage> events;              ///< the newest last
};

/// Something is worth a second look, or calls for a person at once.
enum class Look { kNone, kWarning, kAlarm };

/// A line of text, and which parts of it a person must look at.
struct WatchLine {
  struct Part {
    std::string text;
    Look look = Look::kNone;
  };
  std::vector<Part> parts;

  /// With escape sequences of a terminal where `colours`.
  std::string text(bool colours) const;
};

/// The studio in one line, a line for every node with its cameras below, then the last events. At
/// most `height` lines of at most `width` columns: events go first, then cameras that are well.
std::vector<WatchLine> watch_lines(const StudioView& view, size_t width, size_t height);

/// "14:03:11  cap01  cam07: lost ...", local time.
WatchLine event_line(const EventMessage& event);

/// The summary alone: "kendo-07   300 pulses   15/15 cameras ...".
std::string summary_line(const StudioView& view);

}  // namespace v3d::ctl
