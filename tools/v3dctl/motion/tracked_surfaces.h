// The surfaces of a motion file.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "base/geometry/mesh.h"
#include "codec/motion_codec.h"

namespace v3d::ctl {

/// Reads a motion file, segment by segment. One thread.
class TrackedSurfaces {
 public:
  /// A pulse in a segment.
  struct Place {
    size_t segment = 0, index = 0;
    int64_t pulse = 0;
  };

  /// Throws InputError for a file that is missing or damaged.
  explicit TrackedSurfaces(const std::filesystem::path& file);

  const std::vector<codec::MotionSegmentInfo>& segments() const { return reader_->segments(); }
  /// All pulses by ascending segments. A pulse that two segments share occurs twice.
  std::vector<Place> places() const;
  /// The surface at a place, with colours where the file has them. Throws InputError where the file
  /// is damaged.
  Mesh read(const Place& place);

 private:
  [[noreturn]] void damaged() const;

  const std::filesystem::path file_;
  const std::string bytes_;
  std::optional<codec::MotionReader> reader_;  ///< of bytes_
};

}  // namespace v3d::ctl
