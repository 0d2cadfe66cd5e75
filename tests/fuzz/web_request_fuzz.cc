// What v3d-viewd parses of a request itself: its target, its range, who sends it, and an order.
#include <spdlog/spdlog.h>

#include <algorithm>

#include "base/name.h"
#include "daemon/viewd/byte_range.h"
#include "daemon/viewd/command_endpoint.h"
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

const std::string kOperators = "operators-token-";

const v3d::Studio& studio() {
  static const v3d::Studio kStudio = [] {
    spdlog::set_level(spdlog::level::off);
    v3d::Studio made;
    made.trigger.rate_hz = 25;
    for (const char* name : {"cam01", "cam02"}) made.cameras.emplace_back().name = name;
    return made;
  }();
  return kStudio;
}

/// v3dctl is called with words of ours, and names that are no options.
void look_at(const v3d::OperatorCommand& order) {
  must(order.take.empty() || v3d::is_file_name(order.take));
  must(order.pulses >= 0 && order.pulses <= 86'400 * 25);
  for (const std::string& word : order.words()) {
    const bool option =
        word == "--json" || word == "--timeout" || word == "--pulses" || word == "--allow-missing";
    must(!word.empty() && (option || word.front() != '-'));
  }
}

void give(const v3d::WebRequest& request) {
  v3d::CommandEndpoint desk(studio(), kOperators);
  const v3d::WebAnswer answer = desk.take(request, v3d::MonotonicInstant());
  const auto order = desk.next();
  must(order.has_value() == (answer.status == 202));
  if (order) look_at(*order);
  must(!order || request.operator_token == kOperators);
  desk.finish({.status = 0, .output = request.body, .errors = request.content_type});
  must(!desk.report().body.empty());
  const v3d::ReadOrder read = v3d::read_order(request.body, studio());
  must(read.order.has_value() == read.wrong.empty());
  must(read.wrong.find('\n') == std::string::npos);
  if (read.order) look_at(*read.order);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  v3d::test::FuzzInput input(data, size);
  v3d::WebRequest request{.method = "GET",
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
  request.content_type = input.text();
  request.operator_token = input.text();
  request.body = input.rest();
  give(request);
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
