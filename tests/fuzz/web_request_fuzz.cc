// What v3d-viewd parses of a request itself: its target, its range, who sends it.
#include "daemon/viewd/byte_range.h"
#include "daemon/viewd/web_access.h"
#include "daemon/viewd/web_target.h"
#include "fuzz_input.h"

using v3d::test::must;

namespace {

void look_at(const v3d::WebTarget& target) {
  for (const std::string& segment : target.path) {
    must(!segment.empty() && segment != "." && segment != "..");
    must(segment.find('/') == std::string::npos && segment.find('\\') == std::string::npos);
    must(segment.find('\0') == std::string::npos && segment.find('\n') == std::string::npos);
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  v3d::test::FuzzInput input(data, size);
  const v3d::WebRequest request{.method = "GET",
                                .target = input.text(),
                                .host = input.text(),
                                .origin = input.text(),
                                .range = input.text(),
                                .cookie = input.text(),
                                .authorization = input.text()};
  const int64_t file_size = input.number<uint32_t>();
  const v3d::ByteRange range = v3d::byte_range(request.range, file_size);
  must(range.first >= 0 && range.size >= 0 && range.first + range.size <= file_size);
  const auto target = v3d::parse_web_target(request.target);
  if (!target) return 0;
  look_at(*target);
  static const std::string kToken = "0123456789abcdef";
  const bool shown = (request.target + request.cookie + request.authorization).find("0123456") !=
                         std::string::npos ||
                     request.target.find('%') != std::string::npos;
  const bool may =
      v3d::WebAccess(kToken).judge(request, *target) != v3d::WebAccess::Verdict::kWantsToken;
  must(!may || shown);
  v3d::WebAccess("").judge(request, *target);
  v3d::WebAccess::is_own_page(request);
  return 0;
}
