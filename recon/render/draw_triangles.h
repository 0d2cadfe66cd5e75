// The inner loop of the depth buffer: triangles into a picture of 1/z.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "base/image.h"
#include "recon/render/screen_vertex.h"

namespace v3d {

/// Which sides of triangles are drawn. The front has its corners anticlockwise, seen from there: of
/// a closed surface seen from outside it hides the backs, and kFront draws the same in less time,
/// up to rounding at outlines. Of triangles that are large in the picture both may be drawn.
enum class Faces { kBoth, kFront };

/// Keeps at every pixel centre that a triangle covers (see for_each_span()) the larger of what is
/// there and the triangle's 1/z, which runs evenly across the image and stays between those of the
/// corners. `inverse_z`: size.pixels() numbers, row by row. Triangles with a corner that is not
/// on_screen() are not drawn: their places in `triangles` are appended to `cut`, whatever their
/// side. Any order of the triangles gives the same bits; vectorised for the processor it runs on,
/// with the same bits on every processor.
void draw_triangles(const std::vector<ScreenVertex>& vertices,
                    std::span<const std::array<uint32_t, 3>> triangles, ImageSize size, Faces faces,
                    float* inverse_z, std::vector<uint32_t>& cut);

/// A rectangle of pixels that holds every corner in the image; empty without corners. Corners that
/// are not on_screen() are not looked at.
Rect covered_by(const std::vector<ScreenVertex>& vertices, ImageSize size);

/// value > 0 ? 1 / value : infinity, for each.
void invert(float* values, int count);

}  // namespace v3d
