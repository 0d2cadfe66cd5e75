#include "take/logs/mesh_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/core/error.h"
#include "base/io/file.h"
#include "codec/byte_stream.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"
#include "support/unreadable_byte.h"

namespace v3d::take {
namespace {

using Payload = std::vector<uint8_t>;

Payload payload_of(int64_t pulse) {
  return Payload(20 + static_cast<size_t>(pulse), static_cast<uint8_t>(pulse + 1));
}

void write_meshes(const std::filesystem::path& path, const std::vector<int64_t>& pulses) {
  MeshFileWriter writer(path);
  for (const int64_t pulse : pulses) ASSERT_TRUE(writer.append(pulse, payload_of(pulse)));
  ASSERT_TRUE(writer.close());
}

TEST(Crc32, matches_ieee_802_3) {
  const std::string digits = "123456789";
  EXPECT_EQ(codec::crc32({reinterpret_cast<const uint8_t*>(digits.data()), digits.size()}),
            0xCBF43926);
}

TEST(MeshFile, returns_every_mesh_by_its_pulse) {
  const test::TemporaryFolder folder;
  write_meshes(folder / "mesh.v3d", {0, 1, 5});
  MeshFileReader reader(folder / "mesh.v3d");
  EXPECT_EQ(reader.pulses(), (std::vector<int64_t>{0, 1, 5}));
  EXPECT_FALSE(reader.index_was_rebuilt());
  EXPECT_EQ(reader.read(5).value(), payload_of(5));
  EXPECT_FALSE(reader.read(2).value());
  EXPECT_FALSE(reader.read(6).value());
}

TEST(MeshFile, has_the_documented_bytes) {
  const test::TemporaryFolder folder;
  write_meshes(folder / "mesh.v3d", {7});
  const std::string bytes = read_file(folder / "mesh.v3d");
  ASSERT_EQ(bytes.size(), 16U + 24 + 27 + 8 + 24 + 24);
  EXPECT_EQ(bytes.substr(0, 16), std::string("V3DM\r\n\x1a\n\1\0\0\0\0\0\0\0", 16));
  EXPECT_EQ(bytes.substr(16, 16), std::string("V3DR\x1b\0\0\0\7\0\0\0\0\0\0\0", 16));
  EXPECT_EQ(bytes.substr(67, 8), std::string("V3DI\1\0\0\0", 8));
  EXPECT_EQ(bytes.substr(bytes.size() - 24, 12), std::string("\x43\0\0\0\0\0\0\0\x20\0\0\0", 12));
  EXPECT_EQ(bytes.substr(bytes.size() - 8), "V3DE\r\n\x1a\n");
}

TEST(MeshFile, continues_after_truncation_at_any_byte) {
  const test::TemporaryFolder folder;
  write_meshes(folder / "whole", {0, 1, 5});
  const std::string whole = read_file(folder / "whole");
  for (size_t size = 0; size <= whole.size(); ++size) {
    test::write_text(folder / "mesh.v3d", whole.substr(0, size));
    MeshFileWriter writer(folder / "mesh.v3d", LogOpening::kContinue);
    const size_t kept = writer.size();
    EXPECT_EQ(writer.last_pulse().has_value(), kept > 0);
    ASSERT_TRUE(writer.append(7, payload_of(7)) && writer.close());
    MeshFileReader reader(folder / "mesh.v3d");
    EXPECT_FALSE(reader.index_was_rebuilt());
    ASSERT_EQ(reader.pulses().size(), kept + 1) << size << " bytes";
    EXPECT_EQ(reader.read(7).value(), payload_of(7));
    EXPECT_EQ(reader.read(0).value().has_value(), kept > 0);
    EXPECT_TRUE(size < whole.size() || kept == 3U);
  }
}

TEST(MeshFile, keeps_existing_bytes_when_continued) {
  const test::TemporaryFolder folder;
  write_meshes(folder / "whole", {0, 1, 5});
  const std::string whole = read_file(folder / "whole");
  for (size_t size = 16; size <= whole.size(); ++size) {
    test::write_text(folder / "mesh.v3d", whole.substr(0, size));
    {
      MeshFileWriter writer(folder / "mesh.v3d", LogOpening::kContinue);
      ASSERT_TRUE(writer.append(7, payload_of(7)));
    }
    EXPECT_EQ(read_file(folder / "mesh.v3d").substr(0, size), whole.substr(0, size));
  }
}

TEST(MeshFile, keeps_every_whole_mesh_when_continued_and_truncated_again) {
  const test::TemporaryFolder folder;
  write_meshes(folder / "whole", {0, 1, 5});
  const std::string whole = read_file(folder / "whole");
  for (size_t size = 16; size <= whole.size(); ++size) {
    test::write_text(folder / "mesh.v3d", whole.substr(0, size));
    size_t before = 0;
    {
      MeshFileWriter writer(folder / "mesh.v3d", LogOpening::kContinue);
      before = writer.size();
      for (int64_t pulse = 7; pulse < 17; ++pulse) {
        ASSERT_TRUE(writer.append(pulse, payload_of(pulse)));
      }
    }
    const std::string continued = read_file(folder / "mesh.v3d");
    test::write_text(folder / "mesh.v3d", continued.substr(0, continued.size() - 1));  // no index
    MeshFileReader reader(folder / "mesh.v3d");
    EXPECT_TRUE(reader.index_was_rebuilt());
    ASSERT_EQ(reader.pulses().size(), before + 10) << size << " bytes";
    for (const int64_t pulse : reader.pulses()) {
      EXPECT_EQ(reader.read(pulse).value(), payload_of(pulse));
    }
  }
}

TEST(MeshFile, does_not_continue_a_file_that_is_not_a_mesh_file) {
  const test::TemporaryFolder folder;
  test::write_text(folder / "mesh.v3d", std::string(100, 'x'));
  EXPECT_THAT(test::message_of<InputError>(
                  [&] { MeshFileWriter writer(folder / "mesh.v3d", LogOpening::kContinue); }),
              testing::HasSubstr("is not a mesh file"));
  EXPECT_EQ(read_file(folder / "mesh.v3d"), std::string(100, 'x'));
}

TEST(MeshFile, accepts_a_file_without_meshes) {
  const test::TemporaryFolder folder;
  write_meshes(folder / "mesh.v3d", {});
  EXPECT_TRUE(MeshFileReader(folder / "mesh.v3d").pulses().empty());
}

TEST(MeshFile, keeps_all_whole_records_when_truncated_at_any_byte) {
  const test::TemporaryFolder folder;
  write_meshes(folder / "whole", {0, 1, 2});
  const std::string whole = read_file(folder / "whole");
  const size_t ends[] = {16, 16 + 44, 16 + 44 + 45, 16 + 44 + 45 + 46};
  for (size_t length = 16; length < whole.size(); ++length) {
    test::write_text(folder / "torn", whole.substr(0, length));
    MeshFileReader reader(folder / "torn");
    const size_t records = (length >= ends[1]) + (length >= ends[2]) + (length >= ends[3]);
    EXPECT_EQ(reader.pulses().size(), records) << length;
    EXPECT_TRUE(reader.index_was_rebuilt()) << length;
    for (const int64_t pulse : reader.pulses()) {
      EXPECT_EQ(reader.read(pulse).value(), payload_of(pulse));
    }
  }
}

TEST(MeshFile, loses_at_most_one_mesh_when_any_byte_is_changed) {
  const test::TemporaryFolder folder;
  write_meshes(folder / "whole", {0, 1, 2});
  std::string bytes = read_file(folder / "whole");
  for (size_t i = 16; i < bytes.size(); ++i) {
    bytes[i] = static_cast<char>(~bytes[i]);
    test::write_text(folder / "damaged", bytes);
    MeshFileReader reader(folder / "damaged");
    int good = 0;
    for (int64_t pulse = 0; pulse < 3; ++pulse) {
      if (const auto payload = reader.read(pulse).value()) {
        EXPECT_EQ(*payload, payload_of(pulse));
        ++good;
      }
    }
    EXPECT_GE(good, 2) << i;
    bytes[i] = static_cast<char>(~bytes[i]);
  }
}

TEST(MeshFile, reports_a_read_error_of_a_mesh_with_path_and_cause_and_a_wrong_checksum_as_damage) {
  const test::TemporaryFolder folder;
  const std::filesystem::path path = folder / "mesh.v3d";
  write_meshes(path, {0, 1, 2});
  MeshFileReader reader(path);
  std::string bytes = read_file(path);
  bytes[16 + 24] = static_cast<char>(~bytes[16 + 24]);  // in the payload of the first record
  test::write_text(path, bytes);
  {
    const test::UnreadableByte bad(16 + 44 + 24);  // in the payload of the second record
    const auto read = reader.read(1);
    ASSERT_FALSE(read);
    EXPECT_EQ(read.error().message, "cannot read " + path.string() + ": Input/output error");
    EXPECT_EQ(reader.read(0).value(), std::nullopt) << "damaged";
    EXPECT_EQ(reader.read(2).value(), payload_of(2));
  }
  EXPECT_EQ(reader.read(1).value(), payload_of(1)) << "the disk reads it again";
}

/// The first fields of a compact frame.
Payload frame_of(int64_t pulse) {
  Payload frame{'V', '3', 'D', 'F', '\r', '\n', 0x1A, '\n'};
  frame.resize(128);
  frame[24] = static_cast<uint8_t>(pulse);
  return frame;
}

TEST(MeshFile, has_no_mesh_of_a_pulse_whose_record_holds_the_frame_of_another_one) {
  const test::TemporaryFolder folder;
  MeshFileWriter writer(folder / "mesh.v3d");
  ASSERT_TRUE(writer.append(5, frame_of(9)) && writer.append(9, frame_of(9)) && writer.close());
  MeshFileReader reader(folder / "mesh.v3d");
  EXPECT_FALSE(reader.read(5).value());
  EXPECT_EQ(reader.read(9).value(), frame_of(9));
  EXPECT_EQ(reader.read_record(5).value().compact, frame_of(9)) << "as it is in the file";
}

TEST(MeshFile, reports_a_mesh_that_another_program_cut_off_as_a_read_error) {
  const test::TemporaryFolder folder;
  write_meshes(folder / "mesh.v3d", {0, 1});
  MeshFileReader reader(folder / "mesh.v3d");
  std::filesystem::resize_file(folder / "mesh.v3d", 16 + 44 + 30);
  EXPECT_EQ(reader.read(0).value(), payload_of(0));
  ASSERT_FALSE(reader.read(1));
  EXPECT_THAT(reader.read(1).error().message, testing::HasSubstr("the file became shorter"));
}

TEST(MeshFile, rejects_files_that_are_not_a_mesh_file_with_their_name) {
  const test::TemporaryFolder folder;
  const auto error_message = [&](const std::string& text) {
    test::write_text(folder / "mesh.v3d", text);
    return test::message_of<InputError>([&] { MeshFileReader reader(folder / "mesh.v3d"); });
  };
  EXPECT_THAT(error_message(""), testing::HasSubstr("mesh.v3d: is not a mesh file"));
  EXPECT_THAT(error_message(std::string(100, 'x')), testing::HasSubstr("is not a mesh file"));
  EXPECT_THAT(error_message(std::string("V3DM\r\n\x1a\n\2\0\0\0\0\0\0\0", 16)),
              testing::HasSubstr("of a version that this program does not support"));
  EXPECT_THAT(test::message_of<InputError>([] { MeshFileReader reader("/nowhere/mesh.v3d"); }),
              testing::HasSubstr("/nowhere/mesh.v3d: No such file"));
  EXPECT_THAT(test::message_of<InputError>([] { MeshFileWriter writer("/nowhere/mesh.v3d"); }),
              testing::HasSubstr("/nowhere/mesh.v3d: No such file"));
}

}  // namespace
}  // namespace v3d::take
