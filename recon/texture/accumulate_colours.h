// What one camera says about the vertices of a mesh: the inner loop of the texture.
#pragma once

#include <array>
#include <cstddef>
#include <optional>

#include "base/colour_response.h"
#include "base/frame.h"
#include "recon/hull/voxel_projection.h"
#include "recon/texture/colour_mask.h"
#include "recon/visibility/point_depth_buffer.h"
#include "recon/visibility/surface_points.h"

namespace v3d {

/// A ColourResponse as the inner loop applies it: common colour = matrix * sample + offset, kept
/// within 0 to 255.
struct SampleCorrection {
  Eigen::Matrix3f matrix;
  Eigen::Vector3f offset;
  explicit SampleCorrection(const ColourResponse& response)
      : matrix(response.matrix.cast<float>()),
        offset((-response.matrix * response.black).cast<float>()) {}
};

/// A camera prepared for one frame. Immutable; safe to use from any thread.
struct VertexCamera {
  VoxelCamera lens;  ///< for points in metres
  Eigen::Vector3f axis{0, 0, 1};
  const Frame* frame = nullptr;  ///< borrowed; its roi is not empty
  /// The pixels of its roi where not the frame's own are to be sampled: what those are in whole
  /// colours.
  std::optional<Image> demosaiced = std::nullopt;
  ColourMask mask;
  PointDepthBuffer depth;
  float tolerance_m = 0;   ///< see TextureOptions::depth_tolerance_m
  float max_slant = 0;     ///< see TextureOptions::most_slant
  float cell_m_per_m = 0;  ///< width of a depth cell in metres at one metre of distance
  /// What all its colours count; empty: the cosine between a vertex's normal and the optical axis,
  std::optional<float> weight;
  /// or the square of this times the cosine over depth; 0: the cosine alone.
  float resolution = 0;
  std::optional<SampleCorrection> colour = std::nullopt;  ///< of all its samples
};

/// Sums over cameras for a block of vertices, the sums of equation (8): red, green and blue times
/// weight, and the weight.
struct ColourSums {
  using Sums = std::array<std::array<float, 4>, PointArrays::kBlock>;
  alignas(64) Sums inner{};  ///< of samples made of foreground alone
  alignas(64) Sums rim{};    ///< of those that may show background
};

/// Adds what the camera sees of the vertices `first` to `first` + kBlock: where the normal faces
/// the camera, nothing hides the vertex and sample_colour() finds a colour. `normals`: those of
/// `vertices`, unit length or zero. Vectorised for the processor it runs on; every processor gives
/// the same bits.
void accumulate_vertex_colours(const VertexCamera& camera, const PointArrays& vertices,
                               const PointArrays& normals, size_t first, ColourSums& sums);

}  // namespace v3d
