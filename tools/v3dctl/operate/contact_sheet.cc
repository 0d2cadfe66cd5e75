#include "v3dctl/operate/contact_sheet.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <string_view>

namespace v3d::ctl {
namespace {

constexpr int kTitleHeight = 22;
constexpr int kGap = 4;
constexpr int kLetterWidth = 5;
constexpr int kLetterHeight = 7;
constexpr int kDot = 2;  // pixels to a dot of a letter
constexpr ImageSize kEmptyCell{320, 240};

using Letter = std::array<uint8_t, kLetterHeight>;  // rows from the top, the left dot is bit 4

// Letters of dots. Small ones are written as capitals.
constexpr std::string_view kKnown = "0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZ-_.:/ ";
constexpr std::array<Letter, kKnown.size()> kLetters = {{
    {14, 17, 19, 21, 25, 17, 14}, {4, 12, 4, 4, 4, 4, 14},      {14, 17, 1, 2, 4, 8, 31},
    {31, 2, 4, 2, 1, 17, 14},     {2, 6, 10, 18, 31, 2, 2},     {31, 16, 30, 1, 1, 17, 14},
    {6, 8, 16, 30, 17, 17, 14},   {31, 1, 2, 4, 8, 8, 8},       {14, 17, 17, 14, 17, 17, 14},
    {14, 17, 17, 15, 1, 2, 12},   {14, 17, 17, 31, 17, 17, 17}, {30, 17, 17, 30, 17, 17, 30},
    {14, 17, 16, 16, 16, 17, 14}, {28, 18, 17, 17, 17, 18, 28}, {31, 16, 16, 30, 16, 16, 31},
    {31, 16, 16, 30, 16, 16, 16}, {14, 17, 16, 23, 17, 17, 15}, {17, 17, 17, 31, 17, 17, 17},
    {14, 4, 4, 4, 4, 4, 14},      {7, 2, 2, 2, 2, 18, 12},      {17, 18, 20, 24, 20, 18, 17},
    {16, 16, 16, 16, 16, 16, 31}, {17, 27, 21, 21, 17, 17, 17}, {17, 17, 25, 21, 19, 17, 17},
    {14, 17, 17, 17, 17, 17, 14}, {30, 17, 17, 30, 16, 16, 16}, {14, 17, 17, 17, 21, 18, 13},
    {30, 17, 17, 30, 20, 18, 17}, {15, 16, 16, 14, 1, 1, 30},   {31, 4, 4, 4, 4, 4, 4},
    {17, 17, 17, 17, 17, 17, 14}, {17, 17, 17, 17, 17, 10, 4},  {17, 17, 17, 21, 21, 21, 10},
    {17, 17, 10, 4, 10, 17, 17},  {17, 17, 17, 10, 4, 4, 4},    {31, 1, 2, 4, 8, 16, 31},
    {0, 0, 0, 31, 0, 0, 0},       {0, 0, 0, 0, 0, 0, 31},       {0, 0, 0, 0, 0, 12, 12},
    {0, 12, 12, 0, 12, 12, 0},    {0, 1, 2, 4, 8, 16, 0},       {0, 0, 0, 0, 0, 0, 0},
}};
constexpr Letter kUnknown = {31, 17, 17, 17, 17, 17, 31};

const Letter& letter_of(char c) {
  const size_t at = kKnown.find(static_cast<char>(std::toupper(static_cast<unsigned char>(c))));
  return at == std::string_view::npos ? kUnknown : kLetters[at];
}

using Colour = std::array<uint8_t, 3>;
constexpr Colour kWhite{255, 255, 255};
constexpr Colour kOutline{255, 0, 200};  // no skin, no cloth and no wall has it
constexpr Colour kNothing{40, 40, 40};

void put(Image& image, int x, int y, const Colour& colour) {
  if (x < 0 || y < 0 || x >= image.size.width || y >= image.size.height) return;
  std::copy(colour.begin(), colour.end(), image.row(y) + 3 * x);
}

void fill(Image& image, const Rect& rect, const Colour& colour) {
  for (int y = rect.y0; y < rect.y0 + rect.height; ++y) {
    for (int x = rect.x0; x < rect.x0 + rect.width; ++x) put(image, x, y, colour);
  }
}

void draw_letter(Image& image, int x, int y, const Letter& letter) {
  for (int row = 0; row < kLetterHeight; ++row) {
    for (int column = 0; column < kLetterWidth; ++column) {
      if ((letter[static_cast<size_t>(row)] >> (kLetterWidth - 1 - column) & 1) == 0) continue;
      fill(image, {x + column * kDot, y + row * kDot, kDot, kDot}, kWhite);
    }
  }
}

void paste(Image& sheet, int x, int y, const Image& picture) {
  for (int row = 0; row < picture.size.height; ++row) {
    std::copy_n(picture.row(row), 3 * picture.size.width, sheet.row(y + row) + 3 * x);
  }
}

/// Foreground with background beside it.
void draw_outline(Image& sheet, int x0, int y0, const Mask& mask) {
  const ImageSize size = mask.size();
  const auto is_inside = [&](int x, int y) {
    return x >= 0 && y >= 0 && x < size.width && y < size.height && mask.get(x, y);
  };
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      if (!mask.get(x, y)) continue;
      const bool at_rim = !is_inside(x - 1, y) || !is_inside(x + 1, y) || !is_inside(x, y - 1) ||
                          !is_inside(x, y + 1);
      if (at_rim) put(sheet, x0 + x, y0 + y, kOutline);
    }
  }
}

ImageSize cell_of(const std::vector<SheetPicture>& pictures) {
  ImageSize cell{0, 0};
  for (const SheetPicture& picture : pictures) {
    if (!picture.image) continue;
    cell.width = std::max(cell.width, picture.image->size.width);
    cell.height = std::max(cell.height, picture.image->size.height);
  }
  return cell.width > 0 ? cell : kEmptyCell;
}

void draw_cell(Image& sheet, int x, int y, ImageSize cell, const SheetPicture& picture) {
  draw_text(sheet, x + kGap, y + kGap, picture.name + (picture.image ? "" : "  NO PICTURE"));
  y += kTitleHeight;
  if (!picture.image) return fill(sheet, {x, y, cell.width, cell.height}, kNothing);
  paste(sheet, x, y, *picture.image);
  if (picture.mask && picture.mask->size() == picture.image->size) {
    draw_outline(sheet, x, y, *picture.mask);
  }
}

}  // namespace

void draw_text(Image& image, int x, int y, const std::string& text) {
  for (const char c : text) {
    draw_letter(image, x, y, letter_of(c));
    x += (kLetterWidth + 1) * kDot;
  }
}

Image contact_sheet(const std::vector<SheetPicture>& pictures) {
  const auto count = static_cast<int>(pictures.size());
  const int columns = std::max(1, static_cast<int>(std::ceil(std::sqrt(count))));
  const int rows = std::max(1, (count + columns - 1) / columns);
  const ImageSize cell = cell_of(pictures);
  const ImageSize pitch{cell.width + kGap, cell.height + kTitleHeight + kGap};
  Image sheet({columns * pitch.width + kGap, rows * pitch.height + kGap}, PixelFormat::kRGB8);
  for (int i = 0; i < count; ++i) {
    draw_cell(sheet, kGap + i % columns * pitch.width, kGap + i / columns * pitch.height, cell,
              pictures[static_cast<size_t>(i)]);
  }
  return sheet;
}

}  // namespace v3d::ctl
