#include "calib/boards/board.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <optional>

#include "base/core/check.h"
#include "base/core/error.h"
#include "base/core/units.h"

namespace v3d::calib {
namespace {

constexpr int kMaxSquares = 200;
constexpr std::array kDictionaries = {
    "DICT_4X4_50",   "DICT_4X4_100",       "DICT_4X4_250",  "DICT_4X4_1000", "DICT_5X5_50",
    "DICT_5X5_100",  "DICT_5X5_250",       "DICT_5X5_1000", "DICT_6X6_50",   "DICT_6X6_100",
    "DICT_6X6_250",  "DICT_6X6_1000",      "DICT_7X7_50",   "DICT_7X7_100",  "DICT_7X7_250",
    "DICT_7X7_1000", "DICT_ARUCO_ORIGINAL"};

[[noreturn]] void fail(std::string_view text, const std::string& why) {
  throw InputError(
      "board '" + std::string(text) + "': " + why +
      "; expected chess:9x6:25mm (inner corners) or charuco:4x5:54mm:40.5mm:DICT_4X4_50 "
      "(squares), with :inverted for a white-on-black print");
}

std::vector<std::string> split(std::string_view text) {
  std::vector<std::string> parts(1);
  for (const char c : text) {
    if (c == ':') {
      parts.emplace_back();
    } else {
      parts.back() += c;
    }
  }
  return parts;
}

std::optional<int> whole_number(std::string_view text) {
  int value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return value;
}

/// "9x6".
std::pair<int, int> parse_sides(std::string_view text, std::string_view sides) {
  const size_t x = sides.find('x');
  if (x != std::string_view::npos) {
    const auto a = whole_number(sides.substr(0, x));
    const auto b = whole_number(sides.substr(x + 1));
    if (a && b && *a >= 3 && *b >= 3 && *a <= kMaxSquares && *b <= kMaxSquares) return {*a, *b};
  }
  fail(text, "'" + std::string(sides) + "' is not COLUMNSxROWS, each from 3 to " +
                 std::to_string(kMaxSquares));
}

double parse_side(std::string_view text, const std::string& length) {
  const double metres = parse_length(length);
  if (!(metres > 0)) fail(text, "'" + length + "' is not a positive length");
  return metres;
}

Board parse_chess(std::string_view text, const std::vector<std::string>& parts) {
  if (parts.size() != 3) fail(text, "expected chess:COLUMNSxROWS:SQUARE");
  Board board;
  std::tie(board.corner_columns, board.corner_rows) = parse_sides(text, parts[1]);
  if (board.corner_columns == board.corner_rows) {
    fail(text,
         "a square board looks the same after a quarter turn; use different numbers of columns and "
         "rows");
  }
  board.square_m = parse_side(text, parts[2]);
  return board;
}

Board parse_charuco(std::string_view text, const std::vector<std::string>& parts) {
  if (parts.size() != 5) fail(text, "expected charuco:COLUMNSxROWS:SQUARE:MARKER:DICT");
  Board board;
  board.kind = BoardKind::kCharuco;
  const auto [columns, rows] = parse_sides(text, parts[1]);
  board.corner_columns = columns - 1;
  board.corner_rows = rows - 1;
  board.square_m = parse_side(text, parts[2]);
  board.marker_m = parse_side(text, parts[3]);
  if (board.marker_m >= board.square_m) fail(text, "the marker must be smaller than its square");
  board.dictionary = parts[4];
  if (std::find(kDictionaries.begin(), kDictionaries.end(), parts[4]) == kDictionaries.end()) {
    fail(text, "unknown dictionary '" + parts[4] + "'");
  }
  return board;
}

}  // namespace

std::string Board::text() const {
  const int extra = kind == BoardKind::kChess ? 0 : 1;
  std::string text = kind == BoardKind::kChess ? "chess:" : "charuco:";
  text += std::to_string(corner_columns + extra) + "x" + std::to_string(corner_rows + extra);
  const auto add_length = [&](double metres) {
    std::string length = format_length(metres);
    length.erase(std::remove(length.begin(), length.end(), ' '), length.end());
    text += ":" + length;
  };
  add_length(square_m);
  if (kind == BoardKind::kCharuco) {
    add_length(marker_m);
    text += ":" + dictionary;
  }
  return text + (inverted ? ":inverted" : "");
}

Board parse_board(std::string_view text) {
  std::vector<std::string> parts = split(text);
  const bool inverted = parts.size() > 1 && parts.back() == "inverted";
  if (inverted) parts.pop_back();
  if (parts[0] != "chess" && parts[0] != "charuco") fail(text, "unknown kind of board");
  Board board = parts[0] == "chess" ? parse_chess(text, parts) : parse_charuco(text, parts);
  board.inverted = inverted;
  return board;
}

BoardObservation half_turned(const Board& board, const BoardObservation& observation) {
  V3D_CHECK(board.has_half_turn_symmetry());
  BoardObservation other;
  for (int i = observation.count() - 1; i >= 0; --i) {
    other.corners.push_back(board.corners() - 1 - observation.corners[i]);
    other.pixels.push_back(observation.pixels[i]);
  }
  return other;
}

}  // namespace v3d::calib
