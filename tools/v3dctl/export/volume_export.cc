#include "v3dctl/export/volume_export.h"

#include <fmt/core.h>

#include <algorithm>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "base/core/error.h"
#include "base/image/image_files.h"
#include "base/io/file.h"
#include "codec/motion_codec.h"
#include "common/console.h"
#include "common/partial_file.h"
#include "recon/texture/atlas_colours.h"
#include "take/take_sound.h"
#include "v3dctl/export/mesh_export.h"
#include "v3dctl/motion/tracked_surfaces.h"
#include "v3dctl/options.h"
#include "v3dctl/scene/scene_sound.h"
#include "v3dctl/scene/scene_video.h"

namespace v3d::ctl {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

/// Constant rate factors: 3 to 4 Mbit/s for the simulated swordsman at 2048 texels.
constexpr int kH264Quality = 33, kAv1Quality = 50;
/// Step of decoded positions, metres. The tracker is less exact.
constexpr double kPositionStep = 0.001;
// JPEG quality and largest side, texels, of the still picture in a segment's file: players of
// deliveries do not show it.
constexpr int kStillQuality = 70, kMaxStillSide = 512;

/// Sound is AAC, which browsers and other players read in .mp4 everywhere; Opus in .mp4 is newer.
constexpr const char* kSoundCodec = "mp4a.40.2";

struct TextureVideo {
  const char* file;
  VideoOptions::Codec codec;
  int quality;
  VideoLevel level;
};

/// The videos that a browser chooses from. Throws InputError for a size and rate that exceed every
/// level: decoders in hardware, and many others, would reject such a video.
std::vector<TextureVideo> texture_videos(int side, double rate_hz) {
  const auto av1 = av1_level(side, rate_hz), h264 = h264_level(side, rate_hz);
  if (!av1 || !h264) {
    throw InputError(fmt::format("--atlas {}: expected at most {} for a video at {:g} Hz", side,
                                 max_video_side(rate_hz), rate_hz));
  }
  return {{"texture-av1.mp4", VideoOptions::Codec::kAv1, kAv1Quality, *av1},
          {"texture-h264.mp4", VideoOptions::Codec::kH264, kH264Quality, *h264}};
}

/// The texture, halved until it is small enough for a still picture.
Image still_of(const Image& texture) {
  const int side = texture.size.width;
  int factor = 1;
  while (side / factor > kMaxStillSide && side % (2 * factor) == 0) factor *= 2;
  return reduced(texture, factor);
}

/// The pulses of one segment of the file that are delivered: ascending, not empty.
using SegmentPlaces = std::vector<TrackedSurfaces::Place>;

/// A pulse that two segments share is shown by the later one.
std::vector<SegmentPlaces> places_in(const TrackedSurfaces& surfaces, take::FrameRange range) {
  std::vector<SegmentPlaces> segments;
  for (const TrackedSurfaces::Place& place : surfaces.places()) {
    if (place.pulse < range.begin || place.pulse >= range.end) continue;
    if (!segments.empty() && segments.back().back().segment != place.segment &&
        segments.back().back().pulse == place.pulse) {
      segments.back().pop_back();
      if (segments.back().empty()) segments.pop_back();
    }
    if (segments.empty() || segments.back().back().segment != place.segment) {
      segments.emplace_back();
    }
    segments.back().push_back(place);
  }
  return segments;
}

std::vector<int64_t> pulses_of(const std::vector<SegmentPlaces>& segments) {
  std::vector<int64_t> pulses;
  for (const SegmentPlaces& segment : segments) {
    for (const TrackedSurfaces::Place& place : segment) pulses.push_back(place.pulse);
  }
  return pulses;
}

std::vector<codec::VertexPosition> positions_of(const Mesh& mesh) {
  std::vector<codec::VertexPosition> positions;
  positions.reserve(mesh.vertices.size());
  for (const Eigen::Vector3f& p : mesh.vertices) positions.push_back({p.x(), p.y(), p.z()});
  return positions;
}

struct SegmentCounts {
  size_t vertices = 0, triangles = 0;
};

/// What the manifest states of the written files.
struct WrittenParts {
  std::vector<SegmentCounts> counts;  ///< of each segment
  int64_t incomplete = 0;             ///< pulses without a frame of some camera
  bool has_sound = false;
  std::optional<take::PulseTimecode> timecode;  ///< of the first pulse
};

/// A delivered segment: geometry as a player decodes it, and colours of vertices.
class DeliveredSegment {
 public:
  DeliveredSegment(TrackedSurfaces& surfaces, const SegmentPlaces& places, const fs::path& file) {
    codec::MotionSegment segment;
    for (const TrackedSurfaces::Place& place : places) {
      const Mesh mesh = surfaces.read(place);
      if (place.index == surfaces.segments()[place.segment].key) {
        segment.key = segment.pulses.size();
      }
      segment.pulses.push_back(place.pulse);
      segment.positions.push_back(positions_of(mesh));
      colours_.push_back(mesh.colours);
      if (segment.triangles.empty()) {
        segment.triangles.assign(mesh.triangles.begin(), mesh.triangles.end());
      }
    }
    key_ = segment.key;
    pulses_ = segment.pulses;
    encode(segment, file);
  }

  const std::vector<int64_t>& pulses() const { return pulses_; }
  /// Numbers of vertices and triangles, as the motion file has them.
  SegmentCounts counts() const {
    const codec::MotionSegmentInfo& segment = reader_->segments().front();
    return {segment.vertices, segment.triangles};
  }
  /// Index of the pulse whose surface is in the GLB file.
  size_t key() const { return key_; }
  std::span<const uint8_t> bytes() const { return bytes_; }
  /// The surface of a pulse by its index, with colours of vertices.
  Mesh surface(size_t index) {
    const codec::MotionTemplate& shape = *reader_->surface(0);
    Mesh mesh;
    mesh.triangles.assign(shape.triangles.begin(), shape.triangles.end());
    for (const auto& [x, y, z] : reader_->decode(0, index)->positions) {
      mesh.vertices.emplace_back(x, y, z);
    }
    if (colours_[index].empty()) return mesh;
    for (const uint32_t v : order_) mesh.colours.push_back(colours_[index][v]);
    return mesh;
  }

 private:
  /// Makes a file of this segment alone, and opens it.
  void encode(const codec::MotionSegment& segment, const fs::path& file) {
    codec::MotionWriter writer{codec::MotionEncoderOptions{.step_m = kPositionStep}};
    auto encoded = writer.add(segment);
    if (!encoded) throw InputError(file.string() + ": cannot be encoded again; run v3dctl track");
    order_ = std::move(encoded->order);
    bytes_ = std::move(encoded->bytes);
    alone_ = codec::MotionWriter::header();
    alone_.insert(alone_.end(), bytes_.begin(), bytes_.end());
    reader_ = codec::MotionReader::open(alone_);
    if (!reader_) throw std::logic_error("the encoded segment cannot be read");
  }

  size_t key_ = 0;
  std::vector<int64_t> pulses_;
  std::vector<std::vector<Rgb8>> colours_;  ///< [pulse][vertex of the file of the take]
  std::vector<uint32_t> order_;             ///< [decoded vertex]: that of the file of the take
  std::vector<uint8_t> bytes_, alone_;      ///< the segment; and as a file
  std::optional<codec::MotionReader> reader_;
};

/// Pulses of a delivery: all from the first to the last that has a surface.
struct Span {
  int64_t first = 0, pulses = 0;
};
Span span_of(const std::vector<SegmentPlaces>& segments) {
  const int64_t first = segments.front().front().pulse;
  return {first, segments.back().back().pulse - first + 1};
}

/// The sound of a take, as a file for the encoder of the videos. The file exists as long as the
/// object.
class DeliverySound {
 public:
  /// The file lies in `folder`. Reports sound files that cannot be played in step.
  DeliverySound(const fs::path& take, const fs::path& folder, Span span, double rate_hz) {
    SceneTake whole{.take = take};
    SceneSound sound({{.take = std::move(whole),
                       .rate_hz = rate_hz,
                       .part = {.in = span.first, .length = span.pulses}}},
                     0);
    for (const std::string& file : sound.unplayed()) {
      note("v3dctl: " + file + ": has no map of pulses; the delivery is without this sound");
    }
    if (sound.is_silent()) return;
    file_.emplace(sound, folder / "sound", static_cast<double>(span.pulses) / rate_hz);
  }

  bool is_silent() const { return !file_; }
  fs::path file() const { return file_ ? file_->path() : fs::path(); }

 private:
  std::optional<SceneSoundFile> file_;
};

/// The videos of the texture, one picture for each pulse from the first to the last.
class TextureVideos {
 public:
  /// `sound`: a file with the sound of these pulses; empty: none. `timecode`: of the first one.
  TextureVideos(const fs::path& folder, int side, double rate_hz,
                const std::vector<SegmentPlaces>& segments, const fs::path& sound,
                const std::optional<take::PulseTimecode>& timecode) {
    first_ = next_ = segments.front().front().pulse;
    std::vector<int64_t> keys;
    for (const SegmentPlaces& segment : segments) keys.push_back(segment.front().pulse - first_);
    const std::string first_picture = timecode ? video_timecode(*timecode, rate_hz) : "";
    for (const TextureVideo& video : texture_videos(side, rate_hz)) {
      writers_.push_back(std::make_unique<VideoWriter>(folder / video.file, ImageSize{side, side},
                                                       rate_hz,
                                                       VideoOptions{.codec = video.codec,
                                                                    .quality = video.quality,
                                                                    .level = video.level.name,
                                                                    .key_pictures = keys,
                                                                    .sound = sound,
                                                                    .timecode = first_picture}));
    }
  }

  /// Pulses in between repeat the picture before.
  void add(int64_t pulse, Image picture) {
    for (; next_ < pulse; ++next_) write();
    shown_ = std::move(picture);
    write();
    ++next_;
  }
  void close() {
    for (const auto& writer : writers_) writer->close();
  }

 private:
  void write() {
    for (const auto& writer : writers_) writer->add(shown_);
  }

  int64_t first_ = 0, next_ = 0;
  Image shown_;
  std::vector<std::unique_ptr<VideoWriter>> writers_;
};

/// Media type of a video, for the function canPlayType() of browsers.
std::string media_type(const TextureVideo& video, bool has_sound) {
  const std::string sound = has_sound ? std::string(", ") + kSoundCodec : "";
  return std::string("video/mp4; codecs=\"") + video.level.codec + sound + "\"";
}

Json manifest_of(const take::TakeInfo& info, int side, const std::vector<SegmentPlaces>& segments,
                 const WrittenParts& parts) {
  const auto [first, pulses] = span_of(segments);
  Json manifest = {{"format", "v3d-volume"},  {"version", 1},         {"take", info.name},
                   {"rate_hz", info.rate_hz}, {"first_pulse", first}, {"pulses", pulses},
                   {"motion", "motion.v3d"}};
  if (parts.timecode) {
    manifest["first_timecode"] = parts.timecode->text();
    manifest["timecode_rate"] = name(parts.timecode->rate);
  }
  manifest["texture"]["side"] = side;
  for (const TextureVideo& video : texture_videos(side, info.rate_hz)) {
    manifest["texture"]["videos"].push_back(
        {{"file", video.file}, {"type", media_type(video, parts.has_sound)}});
  }
  if (parts.has_sound) {
    manifest["sound"] = {{"codec", kSoundCodec}, {"rate_hz", kSceneSoundRate}, {"channels", 2}};
  }
  manifest["segments"] = Json::array();
  for (size_t s = 0; s < segments.size(); ++s) {
    manifest["segments"].push_back({{"first_pulse", segments[s].front().pulse},
                                    {"last_pulse", segments[s].back().pulse},
                                    {"surface", fmt::format("segment-{:03}.glb", s)},
                                    {"vertices", parts.counts[s].vertices},
                                    {"triangles", parts.counts[s].triangles}});
  }
  return manifest;
}

/// Writes the segments one after the other.
class VolumeWriter {
 public:
  VolumeWriter(const VolumeExport& request, const fs::path& folder, TrackedSurfaces& surfaces,
               const std::vector<SegmentPlaces>& segments, const take::TakeInfo& info,
               const take::TakeTimecode& timecodes, const fs::path& sound)
      : request_(request),
        folder_(folder),
        surfaces_(surfaces),
        timecodes_(timecodes),
        painter_(request.take, "--format volume"),
        videos_(folder, request.atlas_side, info.rate_hz, segments, sound,
                timecodes.at(span_of(segments).first)),
        motion_(codec::MotionWriter::header()) {
    if (request.uncompressed) io::throw_if_failed(io::create_folders(folder / "textures"));
  }

  /// Returns the counts of the segment.
  SegmentCounts add(size_t number, const SegmentPlaces& places, Progress& progress) {
    DeliveredSegment segment(surfaces_, places, take::TakePaths{request_.take}.motion());
    motion_.insert(motion_.end(), segment.bytes().begin(), segment.bytes().end());
    const recon::AtlasLayout layout =
        painter_.layout_of(segment.surface(segment.key()), request_.atlas_side);
    recon::AtlasFilter filter;
    for (size_t i = 0; i < segment.pulses().size(); ++i) {
      stop_if_interrupted();
      const int64_t pulse = segment.pulses()[i];
      const Mesh mesh = segment.surface(i);
      recon::AtlasColours colours = painter_.paint(mesh, layout, pulse);
      filter.apply(colours);
      Image image = std::move(colours.image);
      if (i == segment.key()) write_surface(number, pulse, mesh, {layout, still_of(image)});
      if (request_.uncompressed) {
        write_png(folder_ / "textures" / fmt::format("{:06}.png", pulse), image.view());
      }
      videos_.add(pulse, std::move(image));
      progress.advance();
    }
    return segment.counts();
  }

  /// Returns the number of pulses without a frame of some camera.
  int64_t finish() {
    videos_.close();
    io::throw_if_failed(io::replace_file(
        folder_ / "motion.v3d", {reinterpret_cast<const char*>(motion_.data()), motion_.size()}));
    return painter_.incomplete();
  }

 private:
  void write_surface(size_t number, int64_t pulse, const Mesh& mesh,
                     const recon::TextureAtlas& atlas) const {
    Mesh plain = mesh;
    plain.colours.clear();
    write_glb(folder_ / fmt::format("segment-{:03}.glb", number), plain,
              {.compression = Compression::kMeshopt,
               .atlas = &atlas,
               .atlas_quality = kStillQuality,
               .number_vertices = true,
               .pulse = pulse,
               .timecode = timecodes_.at(pulse)});
  }

  const VolumeExport& request_;
  const fs::path folder_;
  TrackedSurfaces& surfaces_;
  const take::TakeTimecode& timecodes_;
  TexturePainter painter_;
  TextureVideos videos_;
  std::vector<uint8_t> motion_;
};

/// Writes everything but the manifest.
WrittenParts write_parts(const VolumeExport& request, const fs::path& folder,
                         TrackedSurfaces& surfaces, const std::vector<SegmentPlaces>& segments,
                         const take::TakeInfo& info, const take::TakeTimecode& timecodes) {
  const DeliverySound sound(request.take, folder, span_of(segments), info.rate_hz);
  Progress progress("export", std::ssize(pulses_of(segments)));
  VolumeWriter writer(request, folder, surfaces, segments, info, timecodes, sound.file());
  WrittenParts parts;
  parts.has_sound = !sound.is_silent();
  parts.timecode = timecodes.at(span_of(segments).first);
  for (size_t s = 0; s < segments.size(); ++s) {
    parts.counts.push_back(writer.add(s, segments[s], progress));
  }
  parts.incomplete = writer.finish();
  return parts;
}

}  // namespace

int export_volume(const VolumeExport& request) {
  const take::TakePaths paths{request.take};
  const take::TakeInfo info = take::load_take_info(paths);
  texture_videos(request.atlas_side, info.rate_hz);  // throws
  if (!file_exists(paths.motion())) {
    throw InputError(paths.motion().string() + ": is not there: run v3dctl track " +
                     request.take.string() + " first");
  }
  TrackedSurfaces surfaces(paths.motion());
  const std::vector<SegmentPlaces> segments = places_in(surfaces, request.frames);
  if (segments.empty()) {
    throw InputError(paths.motion().string() + ": has no surface of the pulses of --frames");
  }
  report_missing_pulses(info, request.frames, pulses_of(segments));
  if (const io::Status made = io::create_folders(fs::absolute(request.out).parent_path()); !made) {
    io::throw_input_error(made.error());
  }
  catch_interrupts();
  PartialFolder folder(request.out);
  const take::TakeTimecode timecodes(paths);
  const WrittenParts parts =
      write_parts(request, folder.path(), surfaces, segments, info, timecodes);
  replace_file(folder.path() / "manifest.json",
               manifest_of(info, request.atlas_side, segments, parts).dump(2) + "\n");
  folder.finish();
  return report_incomplete_frames(parts.incomplete, request.take);
}

}  // namespace v3d::ctl
