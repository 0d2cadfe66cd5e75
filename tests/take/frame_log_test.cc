#include "take/logs/frame_log.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <lcm/lcm.h>

#include <algorithm>
#include <array>

#include "base/core/error.h"
#include "base/io/file.h"
#include "support/file_size_limit.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"
#include "take/logs/event_log.h"
#include "take/logs/log_files.h"

namespace v3d::take {
namespace {

using test::TemporaryFolder;

wire::FrameMessage frame_of(int64_t pulse) {
  wire::FrameMessage m;
  m.sent = from_ns<Realtime>(1'700'000'000'000'000'000 + pulse * 40'000'000);
  m.seq = pulse;
  m.take = "kendo-07";
  m.frame.camera = "cam07";
  m.frame.label.pulse = pulse;
  m.frame.sensor_size = {16, 8};
  m.frame.roi = {0, 0, 16, 8};
  m.frame.image = Image({16, 8}, PixelFormat::kBayerRG8);
  for (size_t i = 0; i < m.frame.image.bytes.size(); ++i) {
    m.frame.image.bytes[i] = static_cast<uint8_t>(3 * i + static_cast<size_t>(pulse));
  }
  return m;
}

void write_frames(const std::filesystem::path& path, const std::vector<int64_t>& pulses) {
  EventLogWriter writer(path);
  for (const int64_t pulse : pulses) ASSERT_TRUE(writer.write(frame_of(pulse)));
}

std::vector<int64_t> pulses_of(const FrameLogReader& reader) {
  std::vector<int64_t> pulses;
  for (const FrameLabel& label : reader.labels()) pulses.push_back(label.pulse);
  return pulses;
}

TEST(FrameLog, returns_every_frame_by_its_pulse) {
  const TemporaryFolder folder;
  write_frames(folder / "cam07.lcmlog", {0, 1, 3, 2});
  FrameLogReader reader(folder / "cam07.lcmlog");
  EXPECT_EQ(pulses_of(reader), (std::vector<int64_t>{0, 1, 3, 2}));
  EXPECT_EQ(reader.damaged_events(), 0);
  EXPECT_EQ(reader.torn_bytes(), 0);
  const auto frame = reader.read(3);
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->image.bytes, frame_of(3).frame.image.bytes);
  EXPECT_FALSE(reader.read(4));
}

TEST(FrameLog, returns_the_frame_that_is_not_suspect_where_several_have_one_pulse) {
  const TemporaryFolder folder;
  {
    EventLogWriter writer(folder / "cam07.lcmlog");
    for (const uint8_t content : {1, 2, 3}) {
      wire::FrameMessage message = frame_of(0);
      message.frame.label.suspect = content == 1;
      message.frame.image.bytes[0] = content;
      ASSERT_TRUE(writer.write(message));
    }
  }
  const auto frame = FrameLogReader(folder / "cam07.lcmlog").read(0);
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->image.bytes[0], 2) << "the first certain one";
}

TEST(FrameLog, keeps_all_bits_of_a_deep_image_and_returns_8_of_them) {
  const TemporaryFolder folder;
  wire::FrameMessage message = frame_of(0);
  message.frame.image = Image({16, 8}, PixelFormat::kBayerRG12);
  for (size_t i = 0; i < message.frame.image.bytes.size(); i += 2) {
    message.frame.image.bytes[i] = static_cast<uint8_t>(i);
    message.frame.image.bytes[i + 1] = 0x0a;
  }
  ASSERT_TRUE(EventLogWriter(folder / "cam07.lcmlog").write(message));
  FrameLogReader reader(folder / "cam07.lcmlog");
  const auto deep = reader.read_deep(0);
  ASSERT_TRUE(deep);
  EXPECT_EQ(deep->image.format, PixelFormat::kBayerRG12);
  EXPECT_EQ(deep->image.bytes, message.frame.image.bytes);
  const auto frame = reader.read(0);
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->image.format, PixelFormat::kBayerRG8);
  ASSERT_EQ(frame->image.bytes.size(), 16U * 8);
  EXPECT_EQ(frame->image.bytes[40], (0x0a00 + 80) >> 4);
}

TEST(MiddleFrame, contains_the_middle_byte_of_the_log) {
  for (int64_t frames = 1; frames < 9; ++frames) {
    const TemporaryFolder folder;
    {
      EventLogWriter writer(folder / "cam07.lcmlog");
      for (int64_t pulse = 0; pulse < frames; ++pulse) ASSERT_TRUE(writer.write(frame_of(pulse)));
    }
    const auto frame = read_middle_frame(folder / "cam07.lcmlog");
    ASSERT_TRUE(frame);
    EXPECT_EQ(frame->label.pulse, frames / 2);
    EXPECT_EQ(frame->image.bytes, frame_of(frames / 2).frame.image.bytes);
  }
}

TEST(MiddleFrame, is_in_the_segment_with_the_middle_byte) {
  const TemporaryFolder folder;
  write_frames(folder / "cam07.lcmlog", {0});
  for (const int64_t first : {10, 20}) {
    EventLogWriter writer(folder / "cam07.lcmlog", LogOpening::kContinue);
    for (int64_t n = 0; n < 5; ++n) ASSERT_TRUE(writer.write(frame_of(first + n)));
  }
  EXPECT_EQ(read_middle_frame(folder / "cam07.lcmlog")->label.pulse, 14);
}

TEST(MiddleFrame, is_the_next_whole_frame_where_the_middle_is_damaged) {
  const TemporaryFolder folder;
  const std::filesystem::path log = folder / "cam07.lcmlog";
  write_frames(log, {0, 1, 2, 3, 4});
  std::string text = read_file(log);
  const size_t size = text.size() / 5;
  char& pixel = text[3 * size - 40];
  pixel = static_cast<char>(pixel ^ 1);  // only the checksum is wrong
  test::write_text(log, text);
  EXPECT_EQ(read_middle_frame(log)->label.pulse, 3);
  std::fill(text.begin() + static_cast<ptrdiff_t>(2 * size), text.end(), 'x');
  test::write_text(log, text);
  EXPECT_EQ(read_middle_frame(log)->label.pulse, 0) << "no frame follows the middle";
  test::write_text(log, std::string(5000, 'x'));
  EXPECT_FALSE(read_middle_frame(log));
  test::write_text(log, "");
  EXPECT_FALSE(read_middle_frame(log));
  std::filesystem::remove(log);
  EXPECT_THROW(read_middle_frame(log), InputError);
}

TEST(MiddleFrame, is_no_event_header_among_the_pixels) {
  const TemporaryFolder folder;
  std::vector<uint8_t> header(64);  // of an event with the channel "x" and 9 bytes
  std::ranges::copy(std::to_array<uint8_t>({0xED, 0xA1, 0xDA, 0x01}), header.begin());
  header[23] = 1;
  header[27] = 9;
  header[28] = 'x';
  wire::FrameMessage large = frame_of(1);
  large.frame.sensor_size = {64, 64};
  large.frame.roi = {0, 0, 64, 64};
  large.frame.image = Image({64, 64}, PixelFormat::kBayerRG8);
  for (int y = 0; y < 64; ++y) std::ranges::copy(header, large.frame.image.row(y));
  {
    EventLogWriter writer(folder / "cam07.lcmlog");
    for (const auto& message : {frame_of(0), large, frame_of(2)}) {
      ASSERT_TRUE(writer.write(message));
    }
  }
  EXPECT_EQ(read_middle_frame(folder / "cam07.lcmlog")->label.pulse, 2);
}

TEST(FrameLog, continues_in_a_new_segment_that_readers_join) {
  const TemporaryFolder folder;
  write_frames(folder / "cam07.lcmlog", {0, 1, 2});
  const std::string before = read_file(folder / "cam07.lcmlog");
  for (const int64_t pulse : {7, 8}) {
    EventLogWriter writer(folder / "cam07.lcmlog", LogOpening::kContinue);
    ASSERT_TRUE(writer.write(frame_of(pulse)));
  }
  EXPECT_EQ(read_file(folder / "cam07.lcmlog"), before);
  EXPECT_TRUE(std::filesystem::exists(folder / "cam07.0001.lcmlog"));
  EXPECT_TRUE(std::filesystem::exists(folder / "cam07.0002.lcmlog"));
  FrameLogReader reader(folder / "cam07.lcmlog");
  EXPECT_EQ(pulses_of(reader), (std::vector<int64_t>{0, 1, 2, 7, 8}));
  EXPECT_EQ(reader.read(8)->image.bytes, frame_of(8).frame.image.bytes);
  EXPECT_EQ(reader.read(0)->image.bytes, frame_of(0).frame.image.bytes);
}

TEST(FrameLog, is_read_from_the_end_of_an_event_on) {
  const TemporaryFolder folder;
  EventLogWriter writer(folder / "cam07.lcmlog");
  const std::vector<int64_t> pulses = {3, 4, 5};
  std::vector<int64_t> ends = {0};
  for (const int64_t pulse : pulses) {
    ASSERT_TRUE(writer.write(frame_of(pulse)));
    ends.push_back(writer.bytes());
  }
  for (size_t n = 0; n < ends.size(); ++n) {
    FrameLogReader reader(writer.path(), {}, static_cast<uint64_t>(ends[n]));
    EXPECT_EQ(pulses_of(reader),
              std::vector(pulses.begin() + static_cast<ptrdiff_t>(n), pulses.end()));
    EXPECT_EQ(reader.torn_bytes(), 0);
    const auto last = reader.read(pulses.back());
    ASSERT_EQ(last.has_value(), n < pulses.size());
    EXPECT_TRUE(!last || last->image.bytes == frame_of(pulses.back()).frame.image.bytes);
  }
}

TEST(FrameLog, reports_progress_for_each_event_and_is_not_read_further_after_an_exception) {
  const TemporaryFolder folder;
  write_frames(folder / "cam07.lcmlog", {0, 1, 2, 3, 4});
  int reports = 0;
  const FrameLogReader reader(folder / "cam07.lcmlog", [&] { ++reports; });
  EXPECT_GE(reports, 2 * 5) << "for its header and for its label";
  int last = 0;
  const auto stop = [&] {
    if (++last == 3) throw std::runtime_error("stop");
  };
  EXPECT_THROW(FrameLogReader(folder / "cam07.lcmlog", stop), std::runtime_error);
  EXPECT_EQ(last, 3);
}

TEST(FrameLog, is_continued_with_the_number_of_events_that_the_caller_knows) {
  const TemporaryFolder folder;
  write_frames(folder / "cam07.lcmlog", {0, 1});
  constexpr int64_t kEarlier = 70;
  EventLogWriter writer(folder / "cam07.lcmlog", LogOpening::kContinue, LogHashing::kChecksum,
                        EventLogWriter::kSyncPeriod, kEarlier);
  ASSERT_TRUE(writer.write(frame_of(7)));
  const std::string segment = read_file(folder / "cam07.0001.lcmlog");
  EXPECT_EQ(segment[4 + 7], kEarlier) << "the lowest byte of the event's number";
}

/// Earlier versions recorded such cameras, and a recovery by them found no event.
TEST(FrameLog, returns_the_frames_of_a_camera_whose_channel_is_too_long_for_lcm) {
  const TemporaryFolder folder;
  const std::string camera(64, 'c');
  const std::filesystem::path log = folder / (camera + ".lcmlog");
  wire::FrameMessage message = frame_of(5);
  message.frame.camera = camera;
  ASSERT_TRUE(EventLogWriter(log).write(message));
  EXPECT_TRUE(FrameLogReader(log).read(5));

  const SegmentIndex found_nothing{
      .bytes = std::filesystem::file_size(log), .whole_bytes = 0, .events = 0, .damaged_places = 0};
  ASSERT_TRUE(save_segment_index(log, found_nothing));
  EXPECT_TRUE(FrameLogReader(log).read(5));
  EXPECT_THAT(EventLogReader(log).segments().front().index_error,
              testing::HasSubstr("an earlier version made it, which could not read the log"));
}

TEST(FrameLog, does_not_overwrite_an_existing_log) {
  const TemporaryFolder folder;
  write_frames(folder / "cam07.lcmlog", {0, 1, 2});
  EXPECT_THAT(
      test::message_of<InputError>([&] { EventLogWriter writer(folder / "cam07.lcmlog"); }),
      testing::HasSubstr("cannot create " + (folder / "cam07.lcmlog").string() + ": File exists"));
  EXPECT_EQ(pulses_of(FrameLogReader(folder / "cam07.lcmlog")), (std::vector<int64_t>{0, 1, 2}));
}

TEST(FrameLog, returns_the_first_of_two_frames_of_one_pulse) {
  const TemporaryFolder folder;
  {
    EventLogWriter writer(folder / "log");
    wire::FrameMessage second = frame_of(5);
    second.frame.image.bytes[0] = 99;
    EXPECT_TRUE(writer.write(frame_of(5)));
    EXPECT_TRUE(writer.write(second));
  }
  FrameLogReader reader(folder / "log");
  EXPECT_EQ(pulses_of(reader), (std::vector<int64_t>{5, 5}));
  EXPECT_EQ(reader.read(5)->image.bytes, frame_of(5).frame.image.bytes);
}

TEST(FrameLog, is_readable_by_lcm) {
  const TemporaryFolder folder;
  write_frames(folder / "log", {0, 1});
  lcm_eventlog_t* log = lcm_eventlog_create((folder / "log").c_str(), "r");
  ASSERT_NE(log, nullptr);
  for (int64_t pulse = 0; pulse < 2; ++pulse) {
    lcm_eventlog_event_t* event = lcm_eventlog_read_next_event(log);
    ASSERT_NE(event, nullptr);
    EXPECT_EQ(std::string(event->channel), "V3D_FRAME_cam07");
    EXPECT_EQ(event->eventnum, pulse);
    EXPECT_EQ(event->timestamp, 1'700'000'000'000'000 + pulse * 40'000);
    lcm_eventlog_free_event(event);
  }
  EXPECT_EQ(lcm_eventlog_read_next_event(log), nullptr);
  lcm_eventlog_destroy(log);
}

TEST(FrameLog, keeps_all_whole_events_when_truncated_at_any_byte) {
  const TemporaryFolder folder;
  write_frames(folder / "log", {0, 1, 2});
  const std::string whole = read_file(folder / "log");
  const size_t event = whole.size() / 3;
  for (size_t length = event; length <= whole.size(); ++length) {
    test::write_text(folder / "torn", whole.substr(0, length));
    FrameLogReader reader(folder / "torn");
    EXPECT_EQ(reader.labels().size(), length / event) << length;
    EXPECT_EQ(reader.torn_bytes(), static_cast<int64_t>(length % event)) << length;
    EXPECT_EQ(reader.damaged_events(), 0) << length;
  }
}

TEST(FrameLog, loses_only_the_event_whose_header_is_damaged) {
  const TemporaryFolder folder;
  write_frames(folder / "log", {0, 1, 2});
  const std::string whole = read_file(folder / "log");
  const size_t event = whole.size() / 3;
  for (size_t i = 0; i < 4; ++i) {
    for (const size_t field : {0, 20, 24}) {  // sync word, length of the channel, of the data
      std::string damaged = whole;
      damaged[event + field + i] = static_cast<char>(0x7f ^ damaged[event + field + i]);
      test::write_text(folder / "damaged", damaged);
      FrameLogReader reader(folder / "damaged");
      EXPECT_GE(reader.damaged_events(), 1) << field + i;
      EXPECT_EQ(pulses_of(reader), (std::vector<int64_t>{0, 2})) << field + i;
    }
  }
}

TEST(FrameLog, finds_events_after_an_event_with_a_damaged_length) {
  const TemporaryFolder folder;
  write_frames(folder / "log", {0, 1, 2, 3});
  std::string damaged = read_file(folder / "log");
  const size_t event = damaged.size() / 4;
  // Adds 256 to the length of the data.
  damaged[event + 26] = static_cast<char>(damaged[event + 26] + 1);
  test::write_text(folder / "damaged", damaged);
  FrameLogReader reader(folder / "damaged");
  EXPECT_EQ(pulses_of(reader), (std::vector<int64_t>{0, 2, 3}));
  EXPECT_GE(reader.damaged_events(), 1);
}

TEST(FrameLog, keeps_two_of_three_frames_when_any_byte_is_changed) {
  const TemporaryFolder folder;
  write_frames(folder / "log", {0, 1, 2});
  std::string bytes = read_file(folder / "log");
  for (size_t i = 0; i < bytes.size(); ++i) {
    bytes[i] = static_cast<char>(~bytes[i]);
    test::write_text(folder / "damaged", bytes);
    FrameLogReader reader(folder / "damaged");
    EXPECT_GE(reader.labels().size(), 2U) << i;
    for (const FrameLabel& label : reader.labels()) reader.read(label.pulse);
    bytes[i] = static_cast<char>(~bytes[i]);
  }
}

TEST(FrameLog, counts_events_that_are_not_frames_as_damaged) {
  const TemporaryFolder folder;
  {
    EventLogWriter writer(folder / "log");
    EXPECT_TRUE(writer.write(frame_of(0)));
    EXPECT_TRUE(writer.write(wire::PulseMessage{}));
  }
  FrameLogReader reader(folder / "log");
  EXPECT_EQ(reader.labels().size(), 1U);
  EXPECT_EQ(reader.damaged_events(), 1);
}

TEST(FrameLog, accepts_an_empty_log) {
  const TemporaryFolder folder;
  write_frames(folder / "log", {});
  EXPECT_TRUE(FrameLogReader(folder / "log").labels().empty());
}

TEST(FrameLog, rejects_files_that_are_not_a_log_with_their_name) {
  const TemporaryFolder folder;
  test::write_text(folder / "notes.txt", std::string(1000, 'x'));
  const auto error_message = [&](const std::string& file) {
    return test::message_of<InputError>([&] { FrameLogReader reader(folder / file); });
  };
  EXPECT_THAT(error_message("notes.txt"), testing::HasSubstr("notes.txt: is not an LCM event log"));
  EXPECT_THAT(error_message("missing.lcmlog"), testing::HasSubstr("missing.lcmlog: No such file"));
  EXPECT_THAT(error_message("."), testing::HasSubstr("it is not a regular file"));
}

TEST(FrameLog, reports_a_missing_folder) {
  EXPECT_THAT(test::message_of<InputError>([] { EventLogWriter writer("/nowhere/cam07.lcmlog"); }),
              testing::HasSubstr("/nowhere/cam07.lcmlog: No such file"));
}

TEST(FrameLog, keeps_earlier_events_when_the_disk_is_full) {
  const TemporaryFolder folder;
  {
    EventLogWriter writer(folder / "log");
    ASSERT_TRUE(writer.write(frame_of(0)));
    const int64_t one_event = writer.bytes();
    {
      const test::FileSizeLimit limit(static_cast<rlim_t>(one_event + 100));
      EXPECT_FALSE(writer.write(frame_of(1)));
      EXPECT_FALSE(writer.write(frame_of(2)));
      EXPECT_EQ(writer.bytes(), one_event);
    }
    EXPECT_TRUE(writer.write(frame_of(3)));
  }
  FrameLogReader reader(folder / "log");
  EXPECT_EQ(pulses_of(reader), (std::vector<int64_t>{0, 3}));
  EXPECT_EQ(reader.damaged_events(), 0);
  EXPECT_EQ(reader.torn_bytes(), 0);
}

TEST(PulseLog, returns_every_pulse_in_order) {
  const TemporaryFolder folder;
  {
    EventLogWriter writer(folder / "pulses.lcmlog");
    for (int64_t pulse = 0; pulse < 5; ++pulse) {
      wire::PulseMessage m;
      m.pulse = pulse;
      m.edge = from_ns<Realtime>(pulse * 40'000'003);
      EXPECT_TRUE(writer.write(m));
    }
  }
  const auto pulses = read_pulses(folder / "pulses.lcmlog");
  ASSERT_EQ(pulses.size(), 5U);
  EXPECT_EQ(pulses[4].pulse, 4);
  EXPECT_EQ(to_ns(pulses[4].edge), 160'000'012);
}

TEST(PulseLog, has_the_time_of_a_pulse_on_this_pc_as_the_time_of_its_event) {
  const TemporaryFolder folder;
  wire::PulseMessage pulse;
  pulse.sent = from_ns<Realtime>(7'000'000);
  {
    EventLogWriter writer(folder / "pulses.lcmlog");
    EXPECT_TRUE(writer.write(pulse));
    EXPECT_TRUE(writer.write(pulse, from_ns<Realtime>(9'000'000)));
  }
  const EventLogReader log(folder / "pulses.lcmlog");
  ASSERT_EQ(log.events().size(), 2U);
  EXPECT_EQ(log.events()[0].utime, 7'000) << "of the sending";
  EXPECT_EQ(log.events()[1].utime, 9'000);
}

}  // namespace
}  // namespace v3d::take
