// One file for the surfaces of many pulses.
#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <string>

#include "base/geometry/mesh.h"
#include "take/take_sound.h"
#include "v3dctl/export/gltf_document.h"

namespace v3d::ctl {

struct SequenceOptions {
  std::string take;    ///< name of the take
  double rate_hz = 0;  ///< pulses per second
  /// The timecode of a pulse where it is known; may be empty.
  std::function<std::optional<take::PulseTimecode>(int64_t pulse)> timecode = {};
  uint64_t max_glb_bytes = kMaxGlbBytes;  ///< limit of a GLB file
  /// Limit of the samples of a USD file, which needs up to three times as much memory.
  uint64_t max_usda_bytes = std::numeric_limits<uint64_t>::max();
};

/// Writer of one file. It keeps the content in memory. One thread.
class SurfaceSequence {
 public:
  virtual ~SurfaceSequence() = default;
  /// Adds the surface of a pulse, ascending: world, metres, z up. It may be empty. Throws
  /// InputError where the surfaces so far exceed the format or its limit.
  virtual void add(int64_t pulse, const Mesh& mesh) = 0;
  /// The whole file. Throws InputError where the format cannot hold it. No add() afterwards.
  virtual std::string finish() = 0;
};

/// glTF 2.0 binary with one animation, named as the take.
///
/// Successive surfaces with equal triangles become one mesh: the first pulse and a morph target for
/// each further one, whose weights change linearly from pulse to pulse. COLOR_0 (linear light) is
/// the mean over these pulses. Every other surface is a mesh of its own. The nodes, named by the
/// first pulse as in "000012", are shown in turn: a STEP animation of their scale, 0 or 1. A
/// surface stays until the next pulse that was added. Without animation the first surface shows.
/// The parent of the nodes has the name of the take, rotates z up to y up, and has the extras
/// `take`, `rate_hz` and `pulses`; with timecode also `first_timecode`, that of the first pulse,
/// and `timecode_rate`. The nodes then have the extras of timecode_extras() for their first pulse.
/// Source: https://registry.khronos.org/glTF/specs/2.0/glTF-2.0.html
std::unique_ptr<SurfaceSequence> make_glb_sequence(const SequenceOptions& options);

/// USD text with one Mesh prim, /take/surface: time samples of points, faceVertexCounts,
/// faceVertexIndices, primvars:displayColor (linear light) and extent at time codes equal to the
/// pulses. Triangles that stay have no further sample. metersPerUnit 1, upAxis Z,
/// timeCodesPerSecond the rate.
/// Source: https://openusd.org/release/api/class_usd_geom_mesh.html
std::unique_ptr<SurfaceSequence> make_usda_sequence(const SequenceOptions& options);

}  // namespace v3d::ctl
