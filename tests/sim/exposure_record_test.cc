#include "sim/cameras/exposure_record.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/core/error.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"

namespace v3d::sim {
namespace {

using test::TemporaryFolder;

ExposureLine line(const std::string& camera, int64_t edge) {
  return {camera,
          from_ns<DeviceClock>(1000 + edge),
          from_ns<Monotonic>(2000 + edge),
          edge,
          edge - 2,
          0xfedc'0000'0000'0000 + static_cast<uint64_t>(edge)};
}

std::string refusal(const std::string& text) {
  return test::message_of<InputError>([&] { parse_exposures(text, "e.csv"); });
}

TEST(ExposureRecord, reads_back_every_line_after_it_was_written) {
  const TemporaryFolder folder;
  ExposureRecord record(folder / "exposures.csv");
  std::vector<ExposureLine> written;
  for (int64_t edge = 0; edge < 5; ++edge) {
    written.push_back(line(edge % 2 == 0 ? "cam01" : "cam02", edge));
    record.add(written.back());
    EXPECT_EQ(load_exposures(folder / "exposures.csv"), written) << "flushed at once";
  }
  EXPECT_EQ(record.lost(), 0);
}

TEST(ExposureRecord, reports_line_and_field_of_an_invalid_record) {
  const TemporaryFolder folder;
  const std::string header = "camera,device_time_ns,edge_monotonic_ns,edge,image_index,xxh3\n";
  EXPECT_THAT(refusal(""), testing::HasSubstr("e.csv:1"));
  EXPECT_THAT(refusal("camera,edge\n"), testing::HasSubstr("e.csv:1"));
  EXPECT_THAT(refusal(header + "cam01,1,2,3\n"), testing::HasSubstr("e.csv:2: 4 fields"));
  EXPECT_THAT(refusal(header + "cam01,1,2,3,4,f\ncam01,1,x,3,4,f\n"),
              testing::HasSubstr("e.csv:3: edge_monotonic_ns: \"x\""));
  EXPECT_THAT(refusal(header + "cam01,1,2,3,4,-1\n"), testing::HasSubstr("e.csv:2: xxh3: \"-1\""));
  EXPECT_NO_THROW(parse_exposures(header, "e.csv"));
  EXPECT_THROW(load_exposures(folder / "absent.csv"), InputError);
  EXPECT_THROW(ExposureRecord(folder / "absent/e.csv"), InputError);
}

}  // namespace
}  // namespace v3d::sim
