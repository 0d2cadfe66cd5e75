#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "base/io/file.h"
#include "daemon/captured/take_signers.h"
#include "support/begun_take.h"
#include "support/child_process.h"
#include "support/studio_text.h"
#include "support/temporary_folder.h"
#include "take/ledger/signature_check.h"
#include "take/ledger/verify.h"
#include "take/logs/frame_log.h"
#include "take/take_lock.h"

namespace v3d::captured {
namespace {

namespace fs = std::filesystem;
using test::becomes_true;
using test::within;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

class RecoveredTakeSigning : public testing::Test {
 protected:
  RecoveredTakeSigning() {
    studio_.storage.takes = folder_.path();
    studio_.nodes = {{"cap01", key_.public_key().text()}};
    recover("kendo-07");
  }

  /// A take of cap01 that a crash left open, and its recovery.
  take::TakePaths recover(const std::string& name, bool names_key = true) const {
    const take::TakePaths take{folder_ / name};
    fs::create_directories(take.folder);
    take::TakeInfo info = test::begun_take({"cam01"});
    info.name = name;
    EXPECT_TRUE(save_take_info(take, info));
    std::string studio = test::studio_text({{"cap01", {"cam01"}}, {"cap02", {"cam02"}}});
    if (names_key) studio += "signing_key = 'node.key'\n";
    test::write_text(take.studio(), studio);
    test::write_text(take.calib(), "# the rig\n");
    take::EventLogWriter{take.pulses()};
    take::EventLogWriter{take.frames("cam01")};
    recover_take(take);
    return take;
  }
  std::vector<std::string> unsigned_takes(const std::string& node = "cap01") const {
    std::vector<std::string> errors, names;
    for (const take::TakePaths& take : unsigned_recovered_takes(folder_.path(), node, errors)) {
      names.push_back(take.folder.filename());
    }
    EXPECT_THAT(errors, IsEmpty());
    return names;
  }
  bool is_signed() const { return fs::exists(signature_path(take_, "cap01")); }
  /// The results of one search.
  std::vector<RecoveredTakeSigner::Result> results(RecoveredTakeSigner& signer) const {
    std::vector<RecoveredTakeSigner::Result> all;
    EXPECT_TRUE(becomes_true(
        [&] {
          for (auto& result : signer.results()) all.push_back(std::move(result));
          return !all.empty() && signer.pending() == 0;
        },
        within(60)));
    return all;
  }

  const test::TemporaryFolder folder_;
  const wire::SigningKey key_ = wire::SigningKey::make();
  const std::shared_ptr<const take::TakeSigner> as_cap01_ =
      std::make_shared<const take::TakeSigner>(take::TakeSigner{"cap01", key_});
  const take::TakePaths take_{folder_ / "kendo-07"};
  Studio studio_;
};

TEST_F(RecoveredTakeSigning, states_in_the_signature_that_it_was_made_after_the_recovery) {
  RecoveredTakeSigner signer(studio_, "cap01");
  signer.search(as_cap01_);
  const auto done = results(signer);
  ASSERT_EQ(done.size(), 1U);
  EXPECT_EQ(done[0].take, "kendo-07");
  EXPECT_EQ(done[0].error, "");
  const take::SignatureCheck check = check_signatures(take_, &studio_);
  EXPECT_THAT(check.disagreements, IsEmpty());
  ASSERT_EQ(check.signers.size(), 1U);
  EXPECT_EQ(check.signers[0].occasion, take::SigningOccasion::kRecovery);
  EXPECT_EQ(check.signers[0].files, 4) << "calibration, studio file, pulses, log";
  EXPECT_THAT(unsigned_takes(), IsEmpty());
}

TEST_F(RecoveredTakeSigning, omits_takes_that_are_complete_signed_or_of_another_node_or_time) {
  recover("before-the-key", false);
  const take::TakePaths complete = recover("complete");
  take::TakeInfo info = load_take_info(complete);
  info.state = take::TakeState::kComplete;
  ASSERT_TRUE(save_take_info(complete, info));
  const take::TakePaths is_signed = recover("signed");
  ASSERT_TRUE(sign_whole_take(is_signed, *as_cap01_, take::SigningOccasion::kCommand));
  const take::TakePaths damaged = recover("damaged");
  test::write_text(damaged.info(), "damaged");
  fs::create_directory(folder_ / "no take");
  EXPECT_THAT(unsigned_takes(), ElementsAre("kendo-07"));
  EXPECT_THAT(unsigned_takes("cap02"), ElementsAre("kendo-07", "signed"));
  EXPECT_THAT(unsigned_takes("recon01"), IsEmpty());
}

TEST_F(RecoveredTakeSigning, finds_a_take_that_was_continued_after_its_signature) {
  ASSERT_TRUE(sign_whole_take(take_, *as_cap01_, take::SigningOccasion::kStop));
  EXPECT_THAT(unsigned_takes(), IsEmpty());
  for (int restart = 0; restart < 2; ++restart) {
    ASSERT_TRUE(set_signature_aside(take_, "cap01").value());
    EXPECT_FALSE(set_signature_aside(take_, "cap01").value());
    EXPECT_THAT(unsigned_takes(), ElementsAre("kendo-07"));
    ASSERT_TRUE(sign_whole_take(take_, *as_cap01_, take::SigningOccasion::kRecovery));
    EXPECT_THAT(check_signatures(take_, &studio_).disagreements, IsEmpty());
  }
}

TEST_F(RecoveredTakeSigning, waits_until_the_node_has_recorded) {
  RecoveredTakeSigner signer(studio_, "cap01");
  signer.set_paused(true);
  signer.search(as_cap01_);
  EXPECT_FALSE(becomes_true([&] { return is_signed(); }, within(1)));
  signer.set_paused(false);
  EXPECT_TRUE(becomes_true([&] { return is_signed(); }, within(60)));
}

TEST_F(RecoveredTakeSigning, does_not_sign_a_take_that_the_node_records_again) {
  RecoveredTakeSigner signer(studio_, "cap01");
  {
    const auto hold = signer.hold();
    signer.search(as_cap01_);
    ASSERT_TRUE(becomes_true([&] { return signer.pending() == 1; }, within(60)));
    take::TakeInfo info = load_take_info(take_);
    info.state = take::TakeState::kRecording;
    ASSERT_TRUE(save_take_info(take_, info));
  }
  EXPECT_TRUE(becomes_true([&] { return signer.pending() == 0; }, within(60)));
  EXPECT_FALSE(is_signed());
  EXPECT_THAT(signer.results(), IsEmpty());
}

TEST_F(RecoveredTakeSigning, fails_with_a_cause_while_another_process_holds_the_take) {
  const auto lock = take::TakeLock::acquire(take_, "cap01");
  ASSERT_TRUE(lock);
  RecoveredTakeSigner signer(studio_, "cap01");
  signer.search(as_cap01_);
  const auto done = results(signer);
  ASSERT_EQ(done.size(), 1U);
  EXPECT_THAT(done[0].error, HasSubstr("has locked it"));
  EXPECT_FALSE(is_signed());
}

TEST_F(RecoveredTakeSigning, reports_a_take_that_cannot_be_read_and_signs_the_others) {
  const take::TakePaths other = recover("kendo-06");
  test::write_text(other.ledger(), "damaged");
  const take::TakePaths third = recover("kendo-05");
  test::write_text(third.studio(), "damaged");
  RecoveredTakeSigner signer(studio_, "cap01");
  signer.search(as_cap01_);
  const auto done = results(signer);
  ASSERT_EQ(done.size(), 3U);
  EXPECT_THAT(done[0].error, HasSubstr("kendo-05/studio.toml"));
  EXPECT_THAT(done[1].error, AllOf(HasSubstr("cannot sign"), HasSubstr("kendo-06/ledger.toml")));
  EXPECT_EQ(done[2].error, "");
  EXPECT_TRUE(is_signed());
}

TEST_F(RecoveredTakeSigning, ends_while_it_is_paused) {
  RecoveredTakeSigner signer(studio_, "cap01");
  signer.set_paused(true);
  signer.search(as_cap01_);
}

}  // namespace
}  // namespace v3d::captured
