#include "daemon/viewd/take_pictures.h"

#include <algorithm>
#include <charconv>

#include "base/config/calib_file.h"
#include "base/core/error.h"
#include "base/core/text.h"
#include "base/image/colour.h"
#include "base/image/image_files.h"
#include "daemon/recorded/mesh_frames.h"
#include "daemon/viewd/served_files.h"
#include "daemon/viewd/view_json.h"
#include "take/take.h"

namespace v3d::viewd {
namespace {

/// A decimal number of 0 or more; else empty.
std::optional<int64_t> parse_pulse(const std::string& text) {
  int64_t pulse = 0;
  const char* end = text.data() + text.size();
  const auto parsed = std::from_chars(text.data(), end, pulse);
  if (parsed.ec != std::errc() || parsed.ptr != end || pulse < 0) return {};
  return pulse;
}

/// 404 with `text` for something that the take lacks. Throws InputError if that is unknown.
web::WebResponse absent_response(const std::filesystem::path& take, const std::string& text) {
  throw_if_unreadable(take);
  return web::plain_response(404, text);
}

/// 304 if the browser has the content with this ETag, else the response of `make`.
template <class Make>
web::WebResponse tagged_response(const web::WebRequest& request, const std::string& tag,
                                 const Make& make) {
  std::vector<std::pair<std::string, std::string>> fields = {{"ETag", tag},
                                                             {"Cache-Control", "no-cache"}};
  if (request.if_none_match == tag) return {.status = 304, .fields = std::move(fields)};
  web::WebResponse response = make();
  if (response.status == 200) response.fields = std::move(fields);
  return response;
}

web::WebResponse jpeg_response(const std::optional<std::vector<uint8_t>>& jpeg) {
  if (!jpeg) return web::plain_response(404, "this camera has no frame of this pulse");
  return {.type = "image/jpeg", .body = {jpeg->begin(), jpeg->end()}};
}

web::WebResponse views_response(TakeViews& all, const std::string& take, int64_t pulse) {
  auto message = all.read(take, pulse);
  if (!message) return web::plain_response(404, "there is no mesh of this pulse");
  return {.type = "application/octet-stream", .body = std::move(*message)};
}

}  // namespace

TakePictures::TakePictures(const std::filesystem::path& takes)
    : takes_(takes),
      photographs_(std::make_shared<TakePhotographs>(takes)),
      views_(std::make_shared<TakeViews>(takes)) {}

std::optional<web::WebResponse> TakePictures::respond(const web::WebRequest& request,
                                                      const web::WebTarget& target) const {
  const std::vector<std::string>& path = target.path;
  if (path.size() < 4 || path[0] != "api" || path[1] != "takes") return {};
  if (path.size() == 6 && path[3] == "photographs") {
    return photograph(request, path[2], path[4], path[5]);
  }
  if (path.size() == 4 && path[3] == "thumbnail.jpg") return thumbnail(request, path[2]);
  if (path.size() == 5 && path[3] == "views") return views(request, path[2], path[4]);
  return {};
}

/// The work first closes what is removed or unused.
template <class Make>
web::WebResponse TakePictures::picture_response(Make make) const {
  return deferred_response(web::WorkKind::kPicture,
                           [make = std::move(make), photographs = photographs_, views = views_] {
                             const MonotonicInstant now = Monotonic::now();
                             photographs->close_unused(now);
                             views->close_unused(now);
                             return make();
                           });
}

web::WebResponse TakePictures::closing() const {
  web::WebResponse response = picture_response([] { return web::plain_response(200, "closed"); });
  response.listing = "closing";  // one waits at most
  return response;
}

web::WebResponse TakePictures::photograph(const web::WebRequest& request, const std::string& take,
                                          const std::string& pulse_text,
                                          const std::string& file) const {
  constexpr std::string_view kEnding = ".jpg";
  const auto pulse = parse_pulse(pulse_text);
  const std::string camera = file.substr(0, file.size() - std::min(kEnding.size(), file.size()));
  if (!pulse || !file.ends_with(kEnding) || !is_file_name(take) || !is_file_name(camera)) {
    return web::plain_response(404, "there is no such photograph");
  }
  return picture_response(
      [request, all = photographs_, folder = takes_ / take, take, camera, pulse = *pulse] {
        const auto log = stamp_of_log(take::TakePaths{folder}.frames(camera));
        if (!log)
          return absent_response(folder, "there are no frames of this camera in such a take");
        return tagged_response(request, tag_of(*log),
                               [&] { return jpeg_response(all->read(take, pulse, camera)); });
      });
}

web::WebResponse TakePictures::thumbnail(const web::WebRequest& request,
                                         const std::string& take) const {
  if (!is_file_name(take)) return web::plain_response(404, "there is no such take");
  return deferred_response(
      web::WorkKind::kThumbnail, [request, all = photographs_, folder = takes_ / take, take] {
        const take::TakePaths paths{folder};
        if (!stamp_of(paths.info())) return absent_response(folder, "there is no such take");
        const auto cameras = load_take_info(paths).cameras;
        const auto first = std::ranges::find_if(cameras, [&](const std::string& camera) {
          return stamp_of_log(paths.frames(camera)).has_value();
        });
        if (first == cameras.end()) return absent_response(folder, "this take has no raw frames");
        return tagged_response(request, tag_of(*stamp_of_log(paths.frames(*first))),
                               [&] { return jpeg_response(all->thumbnail(take, *first)); });
      });
}

web::WebResponse TakePictures::views(const web::WebRequest& request, const std::string& take,
                                     const std::string& pulse_text) const {
  const auto pulse = parse_pulse(pulse_text);
  if (!pulse || !is_file_name(take)) return web::plain_response(404, "there is no such view");
  return picture_response([request, all = views_, folder = takes_ / take, take, pulse = *pulse] {
    const auto tag = TakeViews::tag(folder);
    if (!tag)
      return absent_response(folder, "there is no such take, or its raw frames are not here");
    return tagged_response(request, *tag, [&] { return views_response(*all, take, pulse); });
  });
}

namespace {

constexpr int kQuality = 90;

/// The colour correction of the camera; identity if the calibration cannot be read.
ColourResponse response_of(const take::TakePaths& paths, const std::string& camera) {
  try {
    const Rig rig = load_take_calib(paths);
    const int index = find_camera(rig, camera);
    if (index >= 0) return rig[static_cast<size_t>(index)].colour;
  } catch (const InputError&) {
  }
  return {};
}

/// Reduced so that no side exceeds `max_side`. Requires RGB8.
Image small_picture(const Image& picture, int max_side) {
  const auto [width, height] = picture.size;
  const int factor = (std::max(width, height) + max_side - 1) / max_side;
  return std::min(width, height) < factor ? picture : reduced(picture, factor);
}

/// RGB8 picture of a frame. Empty for a frame without pixels.
std::optional<Image> picture(const std::optional<Frame>& raw, const ColourResponse& colour) {
  if (!raw || raw->image.size.pixels() == 0) return {};
  Image rgb = to_rgb(raw->image.view());
  if (!colour.is_identity()) correct(rgb, colour);
  return rgb;
}

}  // namespace

std::optional<std::vector<uint8_t>> TakePhotographs::read(const std::string& take, int64_t pulse,
                                                          const std::string& camera) {
  const std::optional<Frame> raw = frame(take, pulse, camera);
  if (!raw) return {};
  const std::optional<Image> whole = picture(raw, logs_.front().colour);
  if (!whole) return {};
  return encode_jpeg(whole->view(), kQuality);
}

std::optional<std::vector<uint8_t>> TakePhotographs::thumbnail(const std::string& take,
                                                               const std::string& camera) const {
  const take::TakePaths paths{takes_ / take};
  const std::optional<Image> whole =
      picture(take::read_middle_frame(paths.frames(camera)), response_of(paths, camera));
  if (!whole) return {};
  return encode_jpeg(small_picture(*whole, kMaxThumbnailSide).view(), kQuality);
}

std::optional<Frame> TakePhotographs::frame(const std::string& take, int64_t pulse,
                                            const std::string& camera) {
  OpenLog* log = find(take, camera);
  if (log == nullptr) return {};
  if (auto found = log->reader.read(pulse)) return found;
  const auto current = stamp_of_log(log->path);
  if (!current || *current == log->stamp || Monotonic::now() - log->opened < kReindexPeriod)
    return {};
  return open(take, camera, *current)->reader.read(pulse);
}

TakePhotographs::OpenLog* TakePhotographs::find(const std::string& take,
                                                const std::string& camera) {
  const std::filesystem::path path = take::TakePaths{takes_ / take}.frames(camera);
  const auto stamp = stamp_of_log(path);
  const auto known = std::ranges::find(logs_, path, &OpenLog::path);
  const bool same = known != logs_.end() && stamp && known->stamp.inode == stamp->inode &&
                    known->stamp.size <= stamp->size;
  if (same) {
    known->used = Monotonic::now();
    logs_.splice(logs_.begin(), logs_, known);
    return &logs_.front();
  }
  if (known != logs_.end()) logs_.erase(known);
  return stamp ? open(take, camera, *stamp) : nullptr;
}

TakePhotographs::OpenLog* TakePhotographs::open(const std::string& take, const std::string& camera,
                                                const FileStamp& stamp) {
  const take::TakePaths paths{takes_ / take};
  const std::filesystem::path path = paths.frames(camera);
  logs_.remove_if([&](const OpenLog& log) { return log.path == path; });
  take::FrameLogReader reader(path);
  const MonotonicInstant now = Monotonic::now();  // the index of a long log takes minutes
  logs_.push_front({path, stamp, now, now, std::move(reader), response_of(paths, camera)});
  if (logs_.size() > kMaxLogs) logs_.pop_back();
  return &logs_.front();
}

void TakePhotographs::close_unused(MonotonicInstant now) {
  logs_.remove_if([&](const OpenLog& log) {
    if (now - log.used > kMaxUnused) return true;
    const auto current = stamp_of_log(log.path);
    return !current || current->inode != log.stamp.inode;
  });
}

std::optional<std::string> TakeViews::tag(const std::filesystem::path& take) {
  const take::TakePaths paths{take};
  const auto mesh = stamp_of(paths.mesh()), info = stamp_of(paths.info()),
             calib = stamp_of(paths.calib());
  if (!mesh || !info || !calib) return {};
  std::string tag = std::to_string(mesh->inode) + tag_of(*mesh) + tag_of(*calib);
  for (const std::string& camera : load_take_info(paths).cameras) {
    const auto log = stamp_of_log(paths.frames(camera));
    if (!log) return {};
    tag += tag_of(*log);
  }
  std::erase(tag, '"');
  return '"' + tag + '"';
}

std::optional<std::string> TakeViews::read(const std::string& take, int64_t pulse) {
  OpenTake& opened = open(take, pulse);
  if (!std::ranges::binary_search(opened.pulses, pulse)) return {};
  const recon::CompactFrame frame = opened.meshes->read(pulse);
  const recon::FrameSet set =
      observe_all(pulse, recorded::read_used(recorded::used_cameras(frame), opened.frames));
  const Rig& rig = opened.frames.rig();
  return vertex_views_message(pulse, static_cast<int64_t>(frame.mesh.vertices.size()),
                              camera_colours(frame.mesh, recorded::texture_cameras(rig, set),
                                             recorded::texture_options(frame.mesh)),
                              rig);
}

bool TakeViews::has_grown(const OpenTake& take, const FileStamp& mesh, int64_t pulse) {
  return mesh.inode == take.mesh.inode && mesh.size > take.mesh.size &&
         std::ranges::binary_search(take.pulses, pulse);
}

TakeViews::OpenTake& TakeViews::open(const std::string& take, int64_t pulse) {
  const auto current = tag(takes_ / take);
  const auto mesh = stamp_of(take::TakePaths{takes_ / take}.mesh());
  if (!current || !mesh) {
    throw InputError((takes_ / take).string() + ": no meshes, or not all raw frames");
  }
  const auto known = std::ranges::find(open_, take, &OpenTake::name);
  if (known != open_.end() && (known->tag == *current || has_grown(*known, *mesh, pulse))) {
    known->used = Monotonic::now();
    open_.splice(open_.begin(), open_, known);
    return open_.front();
  }
  if (known != open_.end()) open_.erase(known);
  auto meshes = std::make_unique<recorded::MeshFrames>(takes_ / take);
  std::vector<int64_t> pulses = meshes->frames({});
  recorded::TakeFrames frames(takes_ / take, {});
  open_.push_front({take, *current, *mesh, Monotonic::now(), std::move(meshes), std::move(frames),
                    std::move(pulses)});
  if (open_.size() > kMaxTakes) open_.pop_back();
  return open_.front();
}

bool TakeViews::is_removed(const OpenTake& take) const {
  const take::TakePaths paths{takes_ / take.name};
  const auto mesh = stamp_of(paths.mesh());
  return !mesh || mesh->inode != take.mesh.inode ||
         std::ranges::any_of(take.frames.info().cameras, [&](const std::string& camera) {
           return !stamp_of_log(paths.frames(camera));
         });
}

void TakeViews::close_unused(MonotonicInstant now) {
  open_.remove_if(
      [&](const OpenTake& take) { return now - take.used > kMaxUnused || is_removed(take); });
}

}  // namespace v3d::viewd
