#include "daemon/recorded/mesh_frames.h"

#include <algorithm>
#include <array>
#include <fstream>
#include <optional>
#include <span>
#include <utility>

#include "base/core/error.h"
#include "base/io/file.h"
#include "codec/frame_header.h"
#include "codec/motion_codec.h"
#include "codec/motion_header.h"
#include "recon/mesh/mesh_neighbours.h"
#include "recon/render/renderer.h"
#include "recon/texture/texture.h"

namespace v3d::recorded {
namespace {

std::filesystem::path mesh_of(const take::TakePaths& paths, const std::filesystem::path& file) {
  load_take_info(paths);  // throws if the folder is not a take
  if (!file_exists(file)) {
    const std::string option = file == paths.proxy() ? " --proxy LEN" : "";
    throw InputError(file.string() + ": is not there: run v3dctl reconstruct " +
                     paths.folder.string() + option + " first");
  }
  return file;
}

/// mesh.v3d; motion.v3d of a take that has only that, as an edited one.
std::filesystem::path surfaces_of(const take::TakePaths& paths) {
  const bool has_motion_only = !file_exists(paths.mesh()) && file_exists(paths.motion());
  return has_motion_only ? paths.motion() : paths.mesh();
}

std::string text_of(take::FrameRange range) {
  std::string text = std::to_string(range.begin) + ":";
  if (range.end != take::FrameRange{}.end) text += std::to_string(range.end);
  return text;
}

/// Whether all positions are finite and at most 1000 km from the origin along each axis, as in a
/// motion file. The format of compact frames permits others; computations with them overflow.
bool are_near_the_origin(const std::vector<Eigen::Vector3f>& positions) {
  static constexpr float kMaxMetres = 1e6F;
  return std::ranges::all_of(positions, [](const Eigen::Vector3f& position) {
    return (position.array().abs() <= kMaxMetres).all();
  });
}

}  // namespace

bool is_motion_file(const std::filesystem::path& path) {
  std::array<uint8_t, codec::kMotionFileHeaderBytes> header{};
  std::ifstream(path, std::ios::binary)
      .read(reinterpret_cast<char*>(header.data()), std::ssize(header));
  return codec::is_motion_file_header(header);
}

MeshCameras::MeshCameras(const take::TakePaths& paths) : all_(load_take_info(paths).cameras) {
  std::ranges::sort(all_);
  if (file_exists(paths.mesh())) meshes_.emplace(paths.mesh());
}

UsedCameras MeshCameras::at(int64_t pulse) {
  UsedCameras used{pulse, all_, {}};
  if (!meshes_ || !std::ranges::binary_search(meshes_->pulses(), pulse)) return used;
  const auto bytes = meshes_->read(pulse);
  if (!bytes || !*bytes) return used;
  if (auto metadata = codec::read_metadata(**bytes)) {
    used.names = std::move(metadata->cameras);
    used.late = std::move(metadata->late_cameras);
  }
  return used;
}

/// A file with one surface per pulse.
class MeshFrames::Reader {
 public:
  virtual ~Reader() = default;
  virtual const std::vector<int64_t>& pulses() const = 0;
  /// Empty for a damaged frame. Requires a frame that the file has.
  virtual std::optional<recon::CompactFrame> read(int64_t frame) = 0;
  virtual bool is_unfinished() const { return false; }
  virtual void enable_views(bool /*enabled*/) {}
  /// How to get another file.
  virtual std::string remedy() const = 0;
};

/// mesh.v3d.
class MeshFrames::MeshReader : public MeshFrames::Reader {
 public:
  explicit MeshReader(const std::filesystem::path& path) : file_(path) {}

  const std::vector<int64_t>& pulses() const override { return file_.pulses(); }
  bool is_unfinished() const override { return file_.index_was_rebuilt(); }
  void enable_views(bool enabled) override { decoder_.enable_cameras(enabled); }
  std::string remedy() const override { return "reconstruct the take again"; }

  std::optional<recon::CompactFrame> read(int64_t frame) override {
    const auto bytes = io::value_or_throw(file_.read(frame));
    const auto header = bytes ? codec::read_header(*bytes) : std::nullopt;
    if (!header) return std::nullopt;
    codec::DecodeStatus status = decoder_.decode(*bytes);
    if (status == codec::DecodeStatus::kNeedsReference) {
      for (const int64_t before : file_.pulses()) {
        if (before >= header->key_pulse && before < frame && !decode(before)) return std::nullopt;
      }
      status = decoder_.decode(*bytes);
    }
    if (status != codec::DecodeStatus::kOk) return std::nullopt;
    recon::CompactFrame decoded = decoder_.frame();
    if (!are_near_the_origin(decoded.mesh.vertices)) return std::nullopt;
    return decoded;
  }

 private:
  bool decode(int64_t frame) {
    const auto bytes = io::value_or_throw(file_.read(frame));
    return bytes && decoder_.decode(*bytes) == codec::DecodeStatus::kOk;
  }

  take::MeshFileReader file_;
  recon::CompactDecoder decoder_;
};

/// motion.v3d.
class MeshFrames::MotionReader : public MeshFrames::Reader {
 public:
  /// Empty for other files.
  static std::unique_ptr<MotionReader> open(const std::filesystem::path& path,
                                            MeshCameras cameras) {
    auto reader = std::unique_ptr<MotionReader>(new MotionReader(std::move(cameras)));
    reader->bytes_ = read_file(path);
    const std::string& bytes = reader->bytes_;
    reader->motion_ =
        codec::MotionReader::open({reinterpret_cast<const uint8_t*>(bytes.data()), bytes.size()});
    if (!reader->motion_) return nullptr;
    const std::vector<codec::MotionSegmentInfo>& segments = reader->motion_->segments();
    for (size_t s = 0; s < segments.size(); ++s) {
      for (size_t i = 0; i < segments[s].pulses.size(); ++i) {
        const int64_t pulse = segments[s].pulses[i];
        if (!reader->pulses_.empty() && reader->pulses_.back() == pulse) {
          reader->places_.back() = {s, i};  // the later segment shows a shared pulse
          continue;
        }
        reader->pulses_.push_back(pulse);
        reader->places_.push_back({s, i});
      }
    }
    return reader;
  }

  const std::vector<int64_t>& pulses() const override { return pulses_; }
  std::string remedy() const override { return "run v3dctl track again"; }

  std::optional<recon::CompactFrame> read(int64_t frame) override {
    const auto at = std::lower_bound(pulses_.begin(), pulses_.end(), frame) - pulses_.begin();
    const auto [segment, index] = places_[static_cast<size_t>(at)];
    const codec::MotionTemplate* const surface = motion_->surface(segment);
    if (surface == nullptr) return std::nullopt;
    recon::CompactFrame result;
    result.mesh.triangles = surface->triangles;
    const codec::MotionPulse* const pulse = motion_->decode(segment, index);
    if (pulse == nullptr) return std::nullopt;
    result.pulse = frame;
    UsedCameras used = cameras_.at(frame);
    result.cameras = std::move(used.names);
    result.late_cameras = std::move(used.late);
    for (const auto& [x, y, z] : pulse->positions) result.mesh.vertices.emplace_back(x, y, z);
    result.mesh.colours = recon::rgb_colours(pulse->colours);
    return result;
  }

 private:
  struct Place {
    size_t segment, index;
  };
  explicit MotionReader(MeshCameras cameras) : cameras_(std::move(cameras)) {}

  std::string bytes_;
  std::optional<codec::MotionReader> motion_;  ///< of bytes_
  MeshCameras cameras_;
  std::vector<int64_t> pulses_;
  std::vector<Place> places_;  ///< of each pulse
};

MeshFrames::MeshFrames(const std::filesystem::path& take) : MeshFrames(take, surfaces_of({take})) {}

MeshFrames::MeshFrames(const std::filesystem::path& take, const std::filesystem::path& file)
    : path_(mesh_of({take}, file)) {
  if (is_motion_file(path_)) {
    reader_ = MotionReader::open(path_, MeshCameras({take}));
    if (!reader_) throw InputError(path_.string() + ": is damaged: run v3dctl track again");
  } else {
    reader_ = std::make_unique<MeshReader>(path_);
  }
}
MeshFrames MeshFrames::of_proxy(const std::filesystem::path& take) {
  return {take, take::TakePaths{take}.proxy()};
}
MeshFrames::~MeshFrames() = default;
MeshFrames::MeshFrames(MeshFrames&&) noexcept = default;
MeshFrames& MeshFrames::operator=(MeshFrames&&) noexcept = default;

bool MeshFrames::is_unfinished() const { return reader_->is_unfinished(); }
void MeshFrames::enable_views(bool enabled) { reader_->enable_views(enabled); }

std::vector<int64_t> MeshFrames::frames(take::FrameRange range) const {
  const std::vector<int64_t>& all = reader_->pulses();
  if (all.empty()) throw InputError(path_.string() + ": holds no frames");
  std::vector<int64_t> frames;
  std::copy_if(all.begin(), all.end(), std::back_inserter(frames),
               [&](int64_t frame) { return range.contains(frame); });
  if (frames.empty()) {
    throw InputError("--frames " + text_of(range) + ": " + path_.string() + " has frames " +
                     std::to_string(all.front()) + " to " + std::to_string(all.back()));
  }
  return frames;
}

recon::CompactFrame MeshFrames::read(int64_t frame) {
  const std::vector<int64_t>& all = reader_->pulses();
  if (!std::ranges::binary_search(all, frame)) {
    const std::string others = all.empty() ? "it has none"
                                           : "it has " + std::to_string(all.size()) + " from " +
                                                 std::to_string(all.front()) + " to " +
                                                 std::to_string(all.back());
    throw InputError(path_.string() + ": has no frame " + std::to_string(frame) + "; " + others);
  }
  std::optional<recon::CompactFrame> read = reader_->read(frame);
  if (!read) {
    throw InputError(path_.string() + ": frame " + std::to_string(frame) +
                     " is damaged, or of an earlier version: " + reader_->remedy());
  }
  return *std::move(read);
}

recon::TextureOptions texture_options(const Mesh& mesh) {
  const double edge = recon::mean_edge(mesh);
  recon::TextureOptions options;
  options.depth_tolerance_m = 3 * edge;
  options.occluder_radius_m = 0.71 * edge;
  options.demosaic = true;
  options.by_resolution = true;
  return options;
}

std::vector<recon::TextureCamera> texture_cameras(const Rig& rig, const recon::FrameSet& set) {
  std::vector<recon::TextureCamera> cameras;
  for (const Frame& frame : set.frames) {
    const auto index = static_cast<size_t>(find_camera(rig, frame.camera));
    cameras.push_back({&rig[index].model, &frame, &rig[index].colour});
  }
  return cameras;
}

recon::AtlasLayout atlas_layout(const Rig& rig, const Mesh& mesh, int side) {
  constexpr double kTexelsPerPixel = 2;
  const Eigen::Vector3d middle = recon::bounds_of(mesh).center();
  double pixels_per_m = 0;
  for (const RigCamera& camera : rig) {
    const double distance = std::max(0.1, (camera.model.center() - middle).norm());
    pixels_per_m = std::max(pixels_per_m, camera.model.matrix()(0, 0) / distance);
  }
  return recon::lay_out_atlas(mesh,
                              {.side = side, .max_texels_per_m = kTexelsPerPixel * pixels_per_m});
}

FrameColours::FrameColours(TakeFrames& frames, const UsedCameras& used)
    : rig_(frames.rig()), set_(observe_all(used.pulse, read_used(used, frames))) {}

FrameColours::FrameColours(TakeFrames& frames, const recon::CompactFrame& frame)
    : FrameColours(frames, used_cameras(frame)) {
  if (set_.frames.size() == frame.cameras.size()) return;
  throw InputError(frames.paths().folder.string() + ": pulse " + std::to_string(frame.pulse) +
                   ": frames of " + std::to_string(set_.frames.size()) + " of its " +
                   std::to_string(frame.cameras.size()) +
                   " cameras can be read; see v3dctl verify");
}

FrameColours::FrameColours(const std::filesystem::path& take, const recon::CompactFrame& frame) {
  TakeFrames frames(take, frame.cameras);
  *this = FrameColours(frames, frame);
}

Mesh FrameColours::coloured(Mesh mesh) const { return coloured(std::move(mesh), std::nullopt); }

Mesh FrameColours::coloured_for(const CameraModel& eye, Mesh mesh) const {
  return coloured(std::move(mesh), recon::ViewDependence{eye.viewing_direction()});
}

recon::AtlasColours FrameColours::atlas_colours(const Mesh& mesh, const recon::AtlasLayout& layout,
                                                const Mesh* whole) const {
  recon::AtlasColourOptions options;
  options.sampling = texture_options(mesh);
  options.occluder = whole;
  return recon::colour_atlas(mesh, layout, texture_cameras(rig_, set_), options);
}

recon::TextureAtlas FrameColours::atlas(const Mesh& mesh, int side) const {
  recon::AtlasLayout layout = atlas_layout(rig_, mesh, side);
  Image image = atlas_colours(mesh, layout).image;
  return {std::move(layout), std::move(image)};
}

Mesh FrameColours::coloured(Mesh mesh, std::optional<recon::ViewDependence> view) const {
  if (mesh.vertices.empty()) return mesh;
  recon::TextureOptions options = texture_options(mesh);
  options.view = view;
  mesh.colours = colour_vertices(mesh, texture_cameras(rig_, set_), options).colours;
  return mesh;
}

ViewSource resolved(ViewSource source, const std::filesystem::path& take) {
  if (source != ViewSource::kAutomatic) return source;
  const take::TakePaths paths{take};
  const std::vector<std::string> cameras = load_take_info(paths).cameras;
  const bool has_all = std::ranges::all_of(
      cameras, [&](const std::string& camera) { return file_exists(paths.frames(camera)); });
  return has_all ? ViewSource::kPhotographs : ViewSource::kMesh;
}

ViewColours::ViewColours(TakeFrames& photographs, const recon::CompactFrame& frame)
    : frame_(frame), photographs_(std::in_place, photographs, frame) {}

ViewColours::ViewColours(const std::filesystem::path& take, const recon::CompactFrame& frame,
                         ViewSource source)
    : frame_(frame) {
  if (source != ViewSource::kMesh) {
    photographs_.emplace(take, frame);
  } else if (frame.views.empty()) {
    throw InputError(take::TakePaths{take}.mesh().string() + ": frame " +
                     std::to_string(frame.pulse) +
                     " has no colours of cameras; expected a take with raw frames, or one to which "
                     "v3dctl camera-colours added them");
  }
}

Mesh ViewColours::coloured_for(const CameraModel& eye) const {
  if (photographs_) return photographs_->coloured_for(eye, frame_.mesh);
  Mesh mesh = frame_.mesh;
  mesh.colours = recon::blended_views(frame_.mesh.colours, frame_.views, {eye.viewing_direction()});
  return mesh;
}

}  // namespace v3d::recorded
