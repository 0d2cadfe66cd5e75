// Encoder and decoder of the colours that each camera sees at the vertices of a frame.
// docs/compact-frame.md is normative.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "codec/coded_surface.h"
#include "codec/colour_code.h"
#include "codec/vertex_hierarchy.h"
#include "codec/vertex_values.h"

namespace v3d::codec {

/// The data of a frame that encoder and decoder have before its camera colours. Borrows a
/// FrameState.
struct CameraSurface {
  /// Requires colours and known vertices in `state`, and its triangles.
  CameraSurface(const FrameState& state, std::span<const std::array<uint32_t, 3>> triangles);

  VertexTree tree;
  std::vector<std::array<double, 3>> normals;  ///< [vertex]: outward, of any length
  const KnownVertices& known;
  std::span<const LumaChroma> colours;
};

/// The vertex of frame `before` from which each vertex of frame `now` is predicted, as in
/// PreviousFrameColours; kNoVertex: none.
inline constexpr uint32_t kNoVertex = ~0U;
std::vector<uint32_t> previous_vertices(const CodedSurface& before, const CodedSurface& now);

/// The previous frame: its residuals, and the vertices of it.
struct PreviousCameras {
  std::span<const CameraResiduals> cameras;  ///< the same cameras
  std::span<const uint32_t> vertices;        ///< previous_vertices()
};

struct CodedCameras {
  std::vector<uint8_t> bytes;              ///< the section
  std::vector<CameraResiduals> residuals;  ///< that the decoder reconstructs
  int step = 0;                            ///< step of luma
};

/// Finest and coarsest step of luma. Chroma has larger steps in proportion.
inline constexpr int kMinCameraStep = 1, kMaxCameraStep = 100;

/// Encodes with the finest step of luma with at most `max_bytes` bytes; with kMaxCameraStep, the
/// result may be larger. `views` have one entry for each vertex. `previous` may be null.
///
/// A camera does not see a vertex whose normal does not face it, whatever `views` has.
CodedCameras encode_cameras(std::span<const CameraView> views, const CameraSurface& surface,
                            const PreviousCameras* previous, size_t max_bytes);

enum class CameraStatus {
  kOk,
  kMalformed,
  kNeedsPrevious,  ///< predicted from the previous frame, and `previous` is null
};

/// Decodes a section of `cameras` cameras. Unless the result is kOk, `residuals` has no meaning.
CameraStatus decode_cameras(std::span<const uint8_t> bytes, size_t cameras,
                            const CameraSurface& surface, const PreviousCameras* previous,
                            std::vector<CameraResiduals>& residuals);

/// The colours to show.
CameraView view_of(const CameraResiduals& residuals, std::span<const LumaChroma> colours);

}  // namespace v3d::codec
