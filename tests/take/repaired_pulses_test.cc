#include "take/logs/repaired_pulses.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/core/error.h"
#include "base/io/file.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"
#include "take/take_files.h"

namespace v3d::take {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

class RepairedPulses : public testing::Test {
 protected:
  const test::TemporaryFolder folder_;
  const TakePaths paths_{folder_.path()};
  const std::filesystem::path path_ = repaired_pulses_path(paths_, "recon01");
};

TEST_F(RepairedPulses, have_a_file_of_their_node_from_the_first_pulse_on) {
  RepairedPulsesWriter writer(path_);
  EXPECT_FALSE(file_exists(path_));
  EXPECT_THAT(read_repaired_pulses(paths_), IsEmpty());
  EXPECT_TRUE(writer.add(4));
  EXPECT_TRUE(writer.add(17));
  EXPECT_EQ(path_.filename(), "repaired.recon01.txt");
  EXPECT_EQ(read_file(path_), "4\n17\n");
  EXPECT_THAT(read_repaired_pulses(paths_), ElementsAre(4, 17));
}

TEST_F(RepairedPulses, of_all_nodes_are_joined_in_order) {
  EXPECT_TRUE(RepairedPulsesWriter(path_).add(5));
  RepairedPulsesWriter other(repaired_pulses_path(paths_, "recon02"));
  EXPECT_TRUE(other.add(3));
  EXPECT_TRUE(other.add(5));
  EXPECT_THAT(read_repaired_pulses(paths_), ElementsAre(3, 5));
}

TEST_F(RepairedPulses, are_appended_after_a_restart) {
  EXPECT_TRUE(RepairedPulsesWriter(path_).add(5));
  EXPECT_TRUE(RepairedPulsesWriter(path_).add(6));
  EXPECT_EQ(read_file(path_), "5\n6\n");
}

TEST_F(RepairedPulses, do_not_include_a_number_that_a_crash_has_cut) {
  test::write_text(path_, "5\n12");
  EXPECT_THAT(read_repaired_pulses(paths_), ElementsAre(5));
  EXPECT_TRUE(RepairedPulsesWriter(path_).add(345));
  EXPECT_EQ(read_file(path_), "5\n12-\n345\n") << "no byte changes";
  EXPECT_THAT(read_repaired_pulses(paths_), ElementsAre(5, 345));
}

TEST_F(RepairedPulses, are_rejected_with_path_and_line_where_the_text_is_no_pulse) {
  for (const char* line : {"x", "-3", "1 2", "99999999999999999999", "10000000", ""}) {
    test::write_text(path_, "5\n" + std::string(line) + "\n");
    EXPECT_THAT(test::message_of<InputError>([&] { read_repaired_pulses(paths_); }),
                HasSubstr("repaired.recon01.txt:2: expected the number of a pulse"))
        << line;
  }
}

TEST_F(RepairedPulses, are_written_after_the_ledger) {
  EXPECT_TRUE(is_written_after_ledger("repaired.recon01.txt"));
  EXPECT_FALSE(is_written_after_ledger("repaired..txt"));
  EXPECT_FALSE(is_written_after_ledger("repaired.recon01.lcmlog"));
}

TEST_F(RepairedPulses, report_an_error_of_the_disk_and_continue_after_it) {
  const std::filesystem::path folder = folder_ / "later";
  RepairedPulsesWriter writer(folder / "repaired.recon01.txt");
  EXPECT_FALSE(writer.add(1));
  std::filesystem::create_directory(folder);
  EXPECT_TRUE(writer.add(2));
  EXPECT_THAT(read_repaired_pulses({folder}), ElementsAre(2));
}

}  // namespace
}  // namespace v3d::take
