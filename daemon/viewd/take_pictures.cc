#include "daemon/viewd/take_pictures.h"

#include <algorithm>
#include <charconv>

#include "base/core/name.h"
#include "daemon/viewd/guarded_answer.h"
#include "daemon/viewd/served_files.h"
#include "daemon/viewd/take_photographs.h"
#include "daemon/viewd/take_views.h"
#include "take/take.h"

namespace v3d {
namespace {

/// A decimal number of 0 or more; else empty.
std::optional<int64_t> parse_pulse(const std::string& text) {
  int64_t pulse = 0;
  const char* end = text.data() + text.size();
  const auto parsed = std::from_chars(text.data(), end, pulse);
  if (parsed.ec != std::errc() || parsed.ptr != end || pulse < 0) return {};
  return pulse;
}

/// 304 if the browser has the content with this ETag, else the answer of `make`.
template <class Make>
WebAnswer tagged_answer(const WebRequest& request, const std::string& tag, const Make& make) {
  std::vector<std::pair<std::string, std::string>> fields = {{"ETag", tag},
                                                             {"Cache-Control", "no-cache"}};
  if (request.if_none_match == tag) return {.status = 304, .fields = std::move(fields)};
  WebAnswer answer = make();
  if (answer.status == 200) answer.fields = std::move(fields);
  return answer;
}

WebAnswer photograph_answer(TakePhotographs& all, const std::string& take, int64_t pulse,
                            const std::string& camera) {
  const auto jpeg = all.read(take, pulse, camera);
  if (!jpeg) return plain_answer(404, "this camera has no frame of this pulse");
  return {.type = "image/jpeg", .body = {jpeg->begin(), jpeg->end()}};
}

WebAnswer views_answer(TakeViews& all, const std::string& take, int64_t pulse) {
  auto message = all.read(take, pulse);
  if (!message) return plain_answer(404, "there is no mesh of this pulse");
  return {.type = "application/octet-stream", .body = std::move(*message)};
}

}  // namespace

TakePictures::TakePictures(const std::filesystem::path& takes)
    : takes_(takes),
      photographs_(std::make_shared<TakePhotographs>(takes)),
      views_(std::make_shared<TakeViews>(takes)) {}

std::optional<WebAnswer> TakePictures::answer(const WebRequest& request,
                                              const WebTarget& target) const {
  const std::vector<std::string>& path = target.path;
  if (path.size() < 4 || path[0] != "api" || path[1] != "takes") return {};
  if (path.size() == 6 && path[3] == "photographs") {
    return photograph(request, path[2], path[4], path[5]);
  }
  if (path.size() == 5 && path[3] == "views") return views(request, path[2], path[4]);
  return {};
}

WebAnswer TakePictures::photograph(const WebRequest& request, const std::string& take,
                                   const std::string& pulse_text, const std::string& file) const {
  constexpr std::string_view kEnding = ".jpg";
  const auto pulse = parse_pulse(pulse_text);
  const std::string camera = file.substr(0, file.size() - std::min(kEnding.size(), file.size()));
  if (!pulse || !file.ends_with(kEnding) || !is_file_name(take) || !is_file_name(camera)) {
    return plain_answer(404, "there is no such photograph");
  }
  return later_answer(WorkKind::kPicture, [request, all = photographs_, folder = takes_ / take,
                                           take, camera, pulse = *pulse] {
    const auto log = stamp_of_log(TakePaths{folder}.frames(camera));
    if (!log) return plain_answer(404, "there are no frames of this camera in such a take");
    return tagged_answer(request, tag_of(*log),
                         [&] { return photograph_answer(*all, take, pulse, camera); });
  });
}

WebAnswer TakePictures::views(const WebRequest& request, const std::string& take,
                              const std::string& pulse_text) const {
  const auto pulse = parse_pulse(pulse_text);
  if (!pulse || !is_file_name(take)) return plain_answer(404, "there is no such view");
  return later_answer(
      WorkKind::kPicture, [request, all = views_, folder = takes_ / take, take, pulse = *pulse] {
        const auto tag = TakeViews::tag(folder);
        if (!tag) return plain_answer(404, "there is no such take, or its raw frames are not here");
        return tagged_answer(request, *tag, [&] { return views_answer(*all, take, pulse); });
      });
}

}  // namespace v3d
