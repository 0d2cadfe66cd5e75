// Names, escaping for terminals and HTML, numbers with units.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace v3d {

// Validation of the names of cameras, nodes and takes, which become parts of file names and
// channels.

/// True for 1 to 64 letters, digits, '-', '_' and '.' that do not start with '.' or '-'.
bool is_file_name(std::string_view name);
inline constexpr std::string_view kFileNameRule =
    "use letters, digits, '-', '_' and '.', at most 64 characters; start with a letter, a digit or "
    "'_'";

/// True for a file name that a camera may have.
/// Reserved: "pulses" (the log of the pulses), and names that end in a dot and four digits (later
/// segments of a log, "cam07.0001.lcmlog").
/// Accepts names that are longer than kMaxCameraName, because recordings of earlier versions have
/// some.
bool is_camera_name(std::string_view name);
inline constexpr std::string_view kCameraNameRule =
    "use letters, digits, '-', '_' and '.', at most 51 characters; start with a letter, a digit or "
    "'_'; do not use \"pulses\", nor a dot and four digits at the end";

/// Limits of the names of a studio and of new recordings, in characters: a channel of LCM has at
/// most 63, and the longest prefixes are "V3D_PREVIEW_" of cameras and "V3D_FRAMEKEY_" of nodes.
inline constexpr size_t kMaxCameraName = 51;
inline constexpr size_t kMaxNodeName = 50;

/// "cam00, cam01, ...": the first 24 names; "..." replaces the others.
std::string join_names(const std::vector<std::string>& names);

// Makes untrusted text safe for a terminal, a log or JSON.

/// True when `text` is valid UTF-8, or empty.
bool is_utf8(std::string_view text);
/// Replaces each byte of invalid UTF-8 and each control character by '?'. The result cannot move a
/// cursor or end a line.
std::string printable(std::string_view text);
/// printable() of each line of a text of several lines; keeps the line ends.
std::string printable_text(std::string_view text);

// Parts of the HTML reports: one self-contained file.

/// The page up to and including <body>, with the common style of all reports. `title` is plain
/// text.
std::string html_head(std::string_view title);

/// Plain text escaped for HTML.
std::string html_escaped(std::string_view text);

// Parses and formats lengths, boxes, byte counts and numbers for command lines and reports.

/// Parses a finite number at the start of `text` and removes it. Returns false, and changes
/// nothing, when `text` does not begin with one.
bool consume_number(std::string_view& text, double& value);
/// Parses "8mm", "0.5cm" or "2m" to metres. Throws InputError for anything else, including a number
/// without a unit.
double parse_length(std::string_view text);
/// A length in millimetres below 1 m, else in metres: "8 mm", "1.5 m".
std::string format_length(double metres);
/// "29.5 GB" (powers of 1000).
std::string format_bytes(double bytes);
/// "1,250".
std::string format_count(int64_t n);

}  // namespace v3d
