// Sparse files: a file that takes 4 KiB of the disk can claim any length. Readers allocate no
// memory for the claimed length, read no holes, and report the damage.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "base/core/error.h"
#include "codec/byte_stream.h"
#include "support/address_sanitizer.h"
#include "support/begun_take.h"
#include "support/bytes_read.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"
#include "take/ledger/take_signature.h"
#include "take/ledger/verify.h"
#include "take/logs/frame_log.h"
#include "take/logs/mesh_file.h"
#include "take/logs/mesh_file_layout.h"
#include "take/take.h"

namespace v3d::take {
namespace {

namespace fs = std::filesystem;

constexpr int64_t kMebibyte = 1 << 20;
#ifdef V3D_ADDRESS_SANITIZER
constexpr int64_t kMaxMebibytes = 400;  // AddressSanitizer keeps up to 256 MiB of freed memory
#else
constexpr int64_t kMaxMebibytes = 32;
#endif

/// Peak memory of this process since reset_peak(), bytes.
int64_t peak() {
  std::ifstream in("/proc/self/status");
  for (std::string key; in >> key;) {
    int64_t kibibytes = 0;
    if (key == "VmHWM:" && in >> kibibytes) return 1024 * kibibytes;
  }
  ADD_FAILURE() << "no VmHWM in /proc/self/status";
  return 0;
}
void reset_peak() { std::ofstream("/proc/self/clear_refs") << "5"; }

/// Increase of the peak memory of this process during `read`, MiB.
template <class Read>
int64_t mebibytes_of(Read read) {
  reset_peak();
  const int64_t before = peak();
  read();
  return (peak() - before) / kMebibyte;
}

std::string big_endian(uint64_t n, int bytes) {
  std::string text;
  for (int shift = 8 * (bytes - 1); shift >= 0; shift -= 8) text += static_cast<char>(n >> shift);
  return text;
}

/// Writes a log of one event whose data is a hole of `claimed` bytes.
void write_sparse_event(const fs::path& path, const std::string& channel, uint32_t claimed) {
  const std::string head = big_endian(0xEDA1DA01, 4) + big_endian(0, 8) + big_endian(0, 8) +
                           big_endian(channel.size(), 4) + big_endian(claimed, 4) + channel;
  std::ofstream(path) << head;
  fs::resize_file(path, head.size() + claimed);
}

TEST(SparseLog, of_frames_allocates_no_memory_for_its_claimed_length) {
  const test::TemporaryFolder folder;
  write_sparse_event(folder / "cam01.lcmlog", "V3D_FRAME_cam01", 250 * kMebibyte);
  EXPECT_LT(mebibytes_of([&] {
              const FrameLogReader reader(folder / "cam01.lcmlog");
              EXPECT_TRUE(reader.labels().empty());
              EXPECT_EQ(reader.damaged_events(), 1);
            }),
            kMaxMebibytes);
}

TEST(SparseLog, of_pulses_allocates_no_memory_for_its_claimed_length) {
  const test::TemporaryFolder folder;
  write_sparse_event(folder / "pulses.lcmlog", "V3D_PULSE", 250 * kMebibyte);
  EXPECT_LT(mebibytes_of([&] { EXPECT_TRUE(read_pulses(folder / "pulses.lcmlog").empty()); }),
            kMaxMebibytes);
}

/// Recovery of a take of one camera after a crash, which indexes its logs.
TEST(SparseLog, is_recovered_without_memory_for_its_claimed_length) {
  const test::TemporaryFolder folder;
  const TakePaths paths{folder / "take"};
  fs::create_directory(paths.folder);
  io::throw_if_failed(save_take_info(paths, test::begun_take({"cam01"})));
  write_sparse_event(paths.pulses(), "V3D_PULSE", 250 * kMebibyte);
  write_sparse_event(paths.frames("cam01"), "V3D_FRAME_cam01", 250 * kMebibyte);
  EXPECT_LT(mebibytes_of([&] {
              const Verification found = recover_take(paths);
              EXPECT_THAT(found.disagreements,
                          testing::Contains(testing::HasSubstr("cam01.lcmlog")));
            }),
            kMaxMebibytes);
}

TEST(SparseLog, is_rejected_in_one_line_when_its_only_event_exceeds_the_limit) {
  const test::TemporaryFolder folder;
  const fs::path log = folder / "cam01.lcmlog";
  write_sparse_event(log, "V3D_FRAME_cam01", 300 * kMebibyte);
  const std::string line = log.string() + ": is not an LCM event log: it holds no whole event";
  EXPECT_LT(mebibytes_of([&] {
              EXPECT_EQ(test::message_of<InputError>([&] { FrameLogReader reader(log); }), line);
              EXPECT_EQ(test::message_of<InputError>([&] { read_pulses(log); }), line);
            }),
            kMaxMebibytes);
}

/// A hole of 4 TiB. Reading it would exceed the time limit of a test.
constexpr uint64_t kLongHole = uint64_t{4} << 40;

TEST(SparseLog, is_searched_for_events_outside_holes_only) {
  const test::TemporaryFolder folder;
  const fs::path log = folder / "cam01.lcmlog";
  write_sparse_event(log, "V3D_FRAME_cam01", 5000);
  fs::resize_file(log, kLongHole);
  EXPECT_EQ(FrameLogReader(log).damaged_events(), 1);
}

TEST(SparseLog, of_pulses_is_recovered_in_seconds_for_any_length) {
  const test::TemporaryFolder folder;
  const TakePaths paths{folder / "take"};
  fs::create_directory(paths.folder);
  io::throw_if_failed(save_take_info(paths, test::begun_take({"cam01"})));
  write_sparse_event(paths.pulses(), "V3D_PULSE", 100);
  fs::resize_file(paths.pulses(), kLongHole);
  const auto recover = [&] {
    EXPECT_THAT(recover_take(paths).disagreements,
                testing::Contains(testing::HasSubstr("pulses.lcmlog: has no checksum")));
  };
  recover();
}

std::string error_of_hole(const fs::path& file) {
  return "cannot read " + file.string() +
         ": it has 4,398,04[56],[0-9,]* bytes in holes; expected at most 17,179,869,184";
}

/// A take with three files of 4 TiB that take 4 KiB on the disk: a log and a file of the ledger,
/// and one that the ledger does not list.
TEST(SparseTake, is_verified_without_reading_its_holes) {
  const test::TemporaryFolder folder;
  const TakePaths paths{folder.path()};
  TakeInfo info = test::begun_take({"cam01"});
  info.state = TakeState::kComplete;
  io::throw_if_failed(save_take_info(paths, info));
  write_sparse_event(paths.frames("cam01"), "V3D_FRAME_cam01", 5000);
  Ledger ledger{.take = "kendo-07", .commanded = 1, .sensed = 1, .cameras = {}};
  const fs::path listed = paths.calib(), other = folder / "notes.bin";
  for (const fs::path& file : {paths.frames("cam01"), listed, other}) {
    std::ofstream(file, std::ios::app) << "x";
    fs::resize_file(file, kLongHole);
    if (file == other) continue;
    ledger.files.push_back({.name = file.filename(),
                            .bytes = static_cast<int64_t>(kLongHole),
                            .changed_ns = 0,
                            .checksum = 1});
  }
  io::throw_if_failed(save_ledger(paths.ledger(), ledger));
  const int64_t before = test::bytes_read();
  const Verification found = verify_take(paths);
  EXPECT_LT(test::bytes_read() - before, 100 * kMebibyte);
  for (const fs::path& file : {paths.frames("cam01"), listed, other}) {
    EXPECT_THAT(found.disagreements,
                testing::Contains(testing::MatchesRegex(error_of_hole(file))).Times(1));
    const auto hashed = hash_take_file(paths, file.filename(), static_cast<int64_t>(kLongHole));
    ASSERT_FALSE(hashed);
    EXPECT_THAT(hashed.error().message, testing::MatchesRegex(error_of_hole(file)));
  }
}

TEST(SparseTake, has_the_checksums_of_its_bytes_when_its_holes_are_short) {
  const test::TemporaryFolder folder;
  const TakePaths paths{folder.path()};
  constexpr size_t kData = 100'000, kHole = 5 * kMebibyte + 1234;
  const std::string begin(kData, 'b'), end(kData, 'e');
  for (const char* name : {"sparse", "sparse.lcmlog"}) {
    std::ofstream(folder / name) << begin;
    fs::resize_file(folder / name, kData + kHole);
    std::ofstream(folder / name, std::ios::app) << end;
    fs::resize_file(folder / name, 2 * kData + 2 * kHole);
    const std::string dense = std::string("dense-") + name;
    std::ofstream(folder / dense) << begin << std::string(kHole, '\0') << end
                                  << std::string(kHole, '\0');
    constexpr int64_t kBytes = 2 * kData + 2 * kHole;
    EXPECT_EQ(read_take_file(paths, name, ReadFrom::kPageCache)->checksum,
              read_take_file(paths, dense, ReadFrom::kPageCache)->checksum);
    EXPECT_EQ(hash_take_file(paths, name, kBytes)->root,
              hash_take_file(paths, dense, kBytes)->root);
  }
}

/// Writes a mesh file of `size` bytes, header and hole, followed by `end`.
void write_sparse_meshes(const fs::path& path, uint64_t size, std::span<const uint8_t> end) {
  const std::vector<uint8_t> header = mesh_file::header();
  std::ofstream(path, std::ios::binary)
      .write(reinterpret_cast<const char*>(header.data()), std::ssize(header));
  fs::resize_file(path, size);
  std::ofstream(path, std::ios::binary | std::ios::app)
      .write(reinterpret_cast<const char*>(end.data()), std::ssize(end));
}

std::vector<uint8_t> footer(uint64_t index_offset, uint32_t index_size, uint32_t crc) {
  mesh_file::Writer writer;
  writer.u64(index_offset);
  writer.u32(index_size);
  writer.u32(crc);
  writer.magic(mesh_file::kFooterMagic);
  return writer.bytes();
}

TEST(SparseMeshFile, allocates_no_memory_for_the_mesh_length_in_its_index) {
  const test::TemporaryFolder folder;
  constexpr uint64_t kHole = 400 * uint64_t{kMebibyte};
  mesh_file::Writer index;
  index.magic(mesh_file::kIndexMagic);
  index.u32(1);
  index.u64(0);                       // pulse
  index.u64(mesh_file::kHeaderSize);  // offset
  index.u32(300U << 20);              // length
  index.u32(0);                       // checksum
  std::vector<uint8_t> end = index.bytes();
  const auto foot = footer(kHole, static_cast<uint32_t>(end.size()), codec::crc32(end));
  end.insert(end.end(), foot.begin(), foot.end());
  write_sparse_meshes(folder / "mesh.v3d", kHole, end);
  EXPECT_LT(mebibytes_of([&] {
              MeshFileReader reader(folder / "mesh.v3d");
              EXPECT_TRUE(reader.pulses().empty());
              EXPECT_FALSE(reader.read(0).value());
            }),
            kMaxMebibytes);
}

TEST(SparseMeshFile, allocates_no_memory_for_the_index_length_in_its_footer) {
  const test::TemporaryFolder folder;
  constexpr uint64_t kEnd = 200 * uint64_t{kMebibyte};
  const auto size = static_cast<uint32_t>(kEnd - mesh_file::kHeaderSize);
  write_sparse_meshes(folder / "mesh.v3d", kEnd, footer(mesh_file::kHeaderSize, size, 0));
  EXPECT_LT(mebibytes_of([&] {
              const MeshFileReader reader(folder / "mesh.v3d");
              EXPECT_TRUE(reader.pulses().empty());
            }),
            kMaxMebibytes);
}

TEST(SparseMeshFile, is_searched_for_meshes_outside_holes_only) {
  const test::TemporaryFolder folder;
  write_sparse_meshes(folder / "mesh.v3d", kLongHole, {});
  EXPECT_TRUE(MeshFileReader(folder / "mesh.v3d").pulses().empty());
}

/// 4,000 consecutive record heads; each claims the following 40 MiB.
TEST(SparseMeshFile, is_searched_in_seconds_when_records_claim_the_same_bytes) {
  const test::TemporaryFolder folder;
  constexpr uint32_t kClaim = 40U << 20;
  std::vector<uint8_t> heads = mesh_file::header();
  for (int64_t pulse = 0; pulse < 4000; ++pulse) {
    const auto head = mesh_file::record_head(
        {.pulse = pulse, .offset = 0, .payload_size = kClaim, .payload_crc = 1});
    heads.insert(heads.end(), head.begin(), head.end());
  }
  std::ofstream(folder / "mesh.v3d", std::ios::binary)
      .write(reinterpret_cast<const char*>(heads.data()), std::ssize(heads));
  fs::resize_file(folder / "mesh.v3d", heads.size() + kClaim + 5000);
  EXPECT_LT(mebibytes_of([&] { MeshFileReader reader(folder / "mesh.v3d"); }), kMaxMebibytes);
}

}  // namespace
}  // namespace v3d::take
