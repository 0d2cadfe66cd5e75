// Fuzz target: calibrations of other programs and tables of time stamps. Any text is read or
// rejected with an InputError; what was read can be written and read again. The first byte selects
// the reader. Files of OpenCV are excluded, because the parser of OpenCV crashes on some XML with
// invalid attributes.
#include "base/core/error.h"
#include "calib/formats/rig_text.h"
#include "calib/formats/text_fields.h"
#include "fuzz_input.h"

namespace {

using namespace v3d;
using namespace v3d::calib;
using test::must;

void read_colmap(const std::string& text) {
  // Two files, separated by a form feed.
  const size_t end = std::min(text.find('\f'), text.size());
  const Rig rig =
      parse_colmap({text.substr(0, end), text.substr(std::min(end + 1, text.size()))}, "sparse");
  must(parse_colmap(colmap_text(rig), "sparse").size() == rig.size());
}

void read_middlebury(const std::string& text) {
  const Rig rig = parse_middlebury(text, {640, 480}, "par.txt");
  must(parse_middlebury(middlebury_text(rig), {640, 480}, "par.txt").size() == rig.size());
}

void read_time_stamps(const std::string& text) {
  const TimeStamps stamps = parse_time_stamps(text, "t.csv");
  for (const auto& [camera, frames] : stamps) {
    const auto found = frame_instants(stamps, camera, 100, "t.csv");
    must(found.instants.size() + static_cast<size_t>(found.beyond) == frames.size());
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  test::FuzzInput input(data, size);
  const char kind = static_cast<char>(input.number<uint8_t>());
  const std::string text = input.rest();
  try {
    if (kind == 'c') read_colmap(text);
    if (kind == 'm') read_middlebury(text);
    if (kind == 't') read_time_stamps(text);
  } catch (const v3d::InputError&) {
  }
  return 0;
}
