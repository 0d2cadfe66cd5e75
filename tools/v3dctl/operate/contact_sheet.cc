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
constexpr int kGlyphWidth = 5;
constexpr int kGlyphHeight = 7;
constexpr int kDot = 2;  // side of a glyph's dot in pixels
constexpr ImageSize kEmptyCell{320, 240};

using Glyph = std::array<uint8_t, kGlyphHeight>;  // rows from the top; the leftmost dot is bit 4

// Bitmaps of the characters. Lower case letters use those of upper case.
constexpr std::string_view kCharacters = "0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZ-_.:/ ";
constexpr std::array<Glyph, kCharacters.size()> kGlyphs = {{
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
constexpr Glyph kUnknown = {31, 17, 17, 17, 17, 17, 31};

const Glyph& glyph_of(char c) {
  const size_t at =
      kCharacters.find(static_cast<char>(std::toupper(static_cast<unsigned char>(c))));
  return at == std::string_view::npos ? kUnknown : kGlyphs[at];
}

using Colour = std::array<uint8_t, 3>;
constexpr Colour kWhite{255, 255, 255};
constexpr Colour kOutline{255, 0, 200};  // rare in skin, clothes and walls
constexpr Colour kNoImage{40, 40, 40};

void put(Image& image, int x, int y, const Colour& colour) {
  if (x < 0 || y < 0 || x >= image.size.width || y >= image.size.height) return;
  std::copy(colour.begin(), colour.end(), image.row(y) + 3 * x);
}

void fill(Image& image, const Rect& rect, const Colour& colour) {
  for (int y = rect.y0; y < rect.y0 + rect.height; ++y) {
    for (int x = rect.x0; x < rect.x0 + rect.width; ++x) put(image, x, y, colour);
  }
}

void draw_glyph(Image& image, int x, int y, const Glyph& glyph) {
  for (int row = 0; row < kGlyphHeight; ++row) {
    for (int column = 0; column < kGlyphWidth; ++column) {
      if ((glyph[static_cast<size_t>(row)] >> (kGlyphWidth - 1 - column) & 1) == 0) continue;
      fill(image, {x + column * kDot, y + row * kDot, kDot, kDot}, kWhite);
    }
  }
}

void paste(Image& sheet, int x, int y, const Image& image) {
  for (int row = 0; row < image.size.height; ++row) {
    std::copy_n(image.row(row), 3 * image.size.width, sheet.row(y + row) + 3 * x);
  }
}

/// Colours foreground pixels that have a neighbour in the background.
void draw_outline(Image& sheet, int x0, int y0, const Mask& mask) {
  const ImageSize size = mask.size();
  const auto is_inside = [&](int x, int y) {
    return x >= 0 && y >= 0 && x < size.width && y < size.height && mask.get(x, y);
  };
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      if (!mask.get(x, y)) continue;
      const bool on_outline = !is_inside(x - 1, y) || !is_inside(x + 1, y) ||
                              !is_inside(x, y - 1) || !is_inside(x, y + 1);
      if (on_outline) put(sheet, x0 + x, y0 + y, kOutline);
    }
  }
}

ImageSize cell_of(const std::vector<SheetImage>& images) {
  ImageSize cell{0, 0};
  for (const SheetImage& entry : images) {
    if (!entry.image) continue;
    cell.width = std::max(cell.width, entry.image->size.width);
    cell.height = std::max(cell.height, entry.image->size.height);
  }
  return cell.width > 0 ? cell : kEmptyCell;
}

void draw_cell(Image& sheet, int x, int y, ImageSize cell, const SheetImage& entry) {
  draw_text(sheet, x + kGap, y + kGap, entry.name + (entry.image ? "" : "  NO IMAGE"));
  y += kTitleHeight;
  if (!entry.image) return fill(sheet, {x, y, cell.width, cell.height}, kNoImage);
  paste(sheet, x, y, *entry.image);
  if (entry.mask && entry.mask->size() == entry.image->size) {
    draw_outline(sheet, x, y, *entry.mask);
  }
}

}  // namespace

void draw_text(Image& image, int x, int y, const std::string& text) {
  for (const char c : text) {
    draw_glyph(image, x, y, glyph_of(c));
    x += (kGlyphWidth + 1) * kDot;
  }
}

Image contact_sheet(const std::vector<SheetImage>& images) {
  const auto count = static_cast<int>(images.size());
  const int columns = std::max(1, static_cast<int>(std::ceil(std::sqrt(count))));
  const int rows = std::max(1, (count + columns - 1) / columns);
  const ImageSize cell = cell_of(images);
  const ImageSize pitch{cell.width + kGap, cell.height + kTitleHeight + kGap};
  Image sheet({columns * pitch.width + kGap, rows * pitch.height + kGap}, PixelFormat::kRGB8);
  for (int i = 0; i < count; ++i) {
    draw_cell(sheet, kGap + i % columns * pitch.width, kGap + i / columns * pitch.height, cell,
              images[static_cast<size_t>(i)]);
  }
  return sheet;
}

}  // namespace v3d::ctl
