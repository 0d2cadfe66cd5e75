#include "base/core/html.h"

namespace v3d {
namespace {

constexpr char kStyle[] = R"(<style>
body { font: 15px/1.45 sans-serif; margin: 2em auto; max-width: 70em; padding: 0 1em; color: #222; }
table { border-collapse: collapse; } th, td { padding: .2em .8em; text-align: right; }
th { border-bottom: 1px solid #888; } td:first-child, th:first-child { text-align: left; }
figure { margin: 0; } figcaption { font-size: 90%; } li { margin: .2em 0; }
svg { background: #f4f4f4; border: 1px solid #ccc; }
.row { display: flex; flex-wrap: wrap; gap: 1em; margin: .5em 0 1.5em; }
.row img { display: block; max-width: 100%; border-radius: 3px; }
.beside { display: grid; grid-auto-flow: column; grid-auto-columns: minmax(0, 1fr); gap: 1em; margin: .5em 0 1em; }
.beside img { display: block; width: 100%; border-radius: 3px; }
.note { color: #555; max-width: 50em; }
.scale { height: .9em; width: 24em; border-radius: 3px; }
.marks { display: flex; justify-content: space-between; width: 24em; }
.marks span { display: flex; justify-content: center; width: 0; font-size: 85%; white-space: nowrap; }
</style>)";

}  // namespace

std::string html_escaped(std::string_view text) {
  std::string result;
  for (const char c : text) {
    if (c == '<') {
      result += "&lt;";
    } else if (c == '&') {
      result += "&amp;";
    } else {
      result += c;
    }
  }
  return result;
}

std::string html_head(std::string_view title) {
  return "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>" +
         html_escaped(title) + "</title>\n" + kStyle + "</head><body>\n";
}

std::string data_url(const std::vector<uint8_t>& jpeg) {
  constexpr char kDigits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string url = "data:image/jpeg;base64,";
  for (size_t i = 0; i < jpeg.size(); i += 3) {
    uint32_t bits = 0;
    for (size_t k = 0; k < 3; ++k) bits = bits << 8 | (i + k < jpeg.size() ? jpeg[i + k] : 0U);
    for (size_t k = 0; k < 4; ++k) {
      url += i + k <= jpeg.size() ? kDigits[bits >> (18 - 6 * k) & 63] : '=';
    }
  }
  return url;
}

}  // namespace v3d
