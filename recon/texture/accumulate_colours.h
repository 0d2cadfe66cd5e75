// Accumulates the colours that one camera sees at the vertices of a mesh: the inner loop of the
// texture.
#pragma once

#include <array>
#include <cstddef>
#include <optional>

#include "base/image/colour.h"
#include "base/image/frame.h"
#include "recon/hull/voxel_grid.h"
#include "recon/texture/colour_mask.h"
#include "recon/visibility/point_depth_buffer.h"

namespace v3d::recon {

/// A ColourResponse in single precision: common colour = matrix * sample + offset, clamped to 0 to
/// 255.
struct SampleCorrection {
  Eigen::Matrix3f matrix;
  Eigen::Vector3f offset;
  explicit SampleCorrection(const ColourResponse& response)
      : matrix(response.matrix.cast<float>()),
        offset((-response.matrix * response.black).cast<float>()) {}
};

/// A camera prepared for one frame. Immutable; any thread.
struct VertexCamera {
  VoxelCamera lens;  ///< for points in metres
  Eigen::Vector3f axis{0, 0, 1};
  const Frame* frame = nullptr;  ///< borrowed; its roi is not empty
  /// The pixels of the roi in RGB, sampled instead of those of the frame where present.
  std::optional<Image> demosaiced = std::nullopt;
  ColourMask mask;
  PointDepthBuffer depth;
  float tolerance_m = 0;   ///< see TextureOptions::depth_tolerance_m
  float max_slant = 0;     ///< see TextureOptions::max_slant
  float cell_m_per_m = 0;  ///< width of a depth cell in metres at one metre of distance
  /// Weight of all samples. Empty: the square of `resolution` times cosine over depth, with the
  /// cosine between vertex normal and optical axis;
  std::optional<float> weight;
  /// or, with 0, the cosine alone.
  float resolution = 0;
  std::optional<SampleCorrection> colour = std::nullopt;  ///< applied to all samples
};

/// Weighted sums of equation (8) over cameras for a block of vertices: red, green and blue times
/// weight, and the weight.
struct ColourSums {
  using Sums = std::array<std::array<float, 4>, PointArrays::kBlock>;
  alignas(64) Sums inner{};  ///< samples of foreground pixels alone
  alignas(64) Sums rim{};    ///< samples that may contain background
  /// Samples of ColourMask::background_like(): probably background.
  alignas(64) Sums background_like{};
};

/// Adds the colours of vertices `first` to `first` + kBlock that `camera` sees: the normal faces
/// the camera, no nearer surface hides the vertex, and sample_colour() has a result. `normals`
/// belong to `vertices` (world, metres) and have unit length or are zero. Vectorised by run-time
/// dispatch; every instruction set gives the same bits.
void accumulate_vertex_colours(const VertexCamera& camera, const PointArrays& vertices,
                               const PointArrays& normals, size_t first, ColourSums& sums);

}  // namespace v3d::recon
