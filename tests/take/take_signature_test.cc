// Signatures of takes: every change of a signed take is detected, and a copy is identified as
// authentic.
#include "take/ledger/take_signature.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>

#include "base/core/error.h"
#include "base/io/file.h"
#include "recording.h"
#include "signed_take.h"
#include "support/begun_take.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"
#include "take/ledger/signature_check.h"
#include "take/ledger/take_account.h"
#include "take/ledger/verify.h"
#include "take/logs/frame_log.h"
#include "take/take_transfer.h"

namespace v3d::take {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;
using testing::SizeIs;

constexpr int64_t kPulses = test::kSignedPulses;
class TakeSigning : public test::SignedTake {};

TEST_F(TakeSigning, verifies_with_the_name_and_key_of_its_node) {
  const SignatureCheck found = check();
  EXPECT_THAT(found.disagreements, IsEmpty());
  EXPECT_THAT(found.notes, IsEmpty());
  ASSERT_THAT(found.signers, SizeIs(1));
  EXPECT_EQ(found.signers[0].node, "cap01");
  EXPECT_EQ(found.signers[0].key, cap01_.public_key());
  EXPECT_TRUE(found.signers[0].is_known);
  EXPECT_EQ(found.signers[0].files, 6) << "calibration, pulses, two logs, two plates";
  EXPECT_TRUE(found.is_complete);
}

/// The root of the documented tree (docs/takes.md) with leaves of the lengths `pieces`.
wire::Hash documented_root(const std::string& content, const std::vector<size_t>& pieces) {
  wire::HashTree tree;
  size_t at = 0;
  for (const size_t piece : pieces) {
    wire::LeafHash leaf;
    leaf.add({reinterpret_cast<const uint8_t*>(content.data()) + at, piece});
    tree.add(leaf.value());
    at += piece;
  }
  EXPECT_EQ(at, content.size());
  return tree.root();
}

TEST_F(TakeSigning, has_a_leaf_for_each_event_of_a_log_and_each_mebibyte_of_other_files) {
  constexpr size_t kBlock = 1 << 20;
  const auto root = [&](const fs::path& file) {
    const auto size = static_cast<int64_t>(fs::file_size(file));
    return hash_take_file(take_, file.filename(), size).value().root;
  };
  const std::string log = read_file(take_.frames("cam01"));
  const size_t event = log.size() / kPulses;
  EXPECT_EQ(root(take_.frames("cam01")), documented_root(log, {event, event, event}));

  // A damaged sync word: the second event is not recognised.
  std::string damaged = log;
  damaged[event] = static_cast<char>(damaged[event] ^ 1);
  test::write_text(take_.frames("cam01"), damaged);
  EXPECT_EQ(root(take_.frames("cam01")), documented_root(damaged, {event, 2 * event}));
  // An event that ends after the end of the file is not recognised.
  const std::string torn = log.substr(0, 2 * event + 100);
  test::write_text(take_.frames("cam01"), torn);
  EXPECT_EQ(root(take_.frames("cam01")), documented_root(torn, {event, event, 100}));

  const std::string text = log + std::string(2 * kBlock, ' ');
  test::write_text(take_.calib(), text);
  EXPECT_EQ(root(take_.calib()), documented_root(text, {kBlock, kBlock, log.size()}));
}

TEST_F(TakeSigning, reports_an_unknown_signer_without_a_studio_file) {
  const SignatureCheck found = check_signatures(take_, nullptr);
  EXPECT_THAT(found.disagreements, IsEmpty());
  EXPECT_THAT(found.notes, ElementsAre(HasSubstr("which the studio file does not list")));
  ASSERT_THAT(found.signers, SizeIs(1));
  EXPECT_FALSE(found.signers[0].is_known);
  EXPECT_FALSE(found.is_complete);
}

TEST_F(TakeSigning, has_the_same_roots_from_the_writer_and_from_reading) {
  const TakeSignature before = parse_signature(read_file(signature_file()), signature_file());
  ASSERT_TRUE(sign_whole("cap01", cap01_));
  const TakeSignature after = parse_signature(read_file(signature_file()), signature_file());
  EXPECT_EQ(before.files, after.files);
  for (const TakeFile& file : after.files) EXPECT_TRUE(file.root) << file.name;
}

TEST_F(TakeSigning, states_whether_it_was_signed_at_the_stop_after_a_recovery_or_by_a_command) {
  EXPECT_THAT(read_file(signature_file()), HasSubstr("format = 3"));
  EXPECT_EQ(check().signers.at(0).occasion, SigningOccasion::kStop);
  for (const SigningOccasion occasion : {SigningOccasion::kRecovery, SigningOccasion::kCommand}) {
    ASSERT_TRUE(sign_whole_take(take_, {"cap01", cap01_}, occasion));
    EXPECT_EQ(check().signers.at(0).occasion, occasion);
    EXPECT_TRUE(check().is_complete);
  }
  std::string text = read_file(signature_file());
  text.replace(text.find("'command'"), 9, "'stop'");
  EXPECT_THAT(error_message(text), HasSubstr("its signature is wrong"));
  text.replace(text.find("'stop'"), 6, "'later'");
  EXPECT_THAT(error_message(text), HasSubstr("expected stop, recovery or command"));
}

TEST_F(TakeSigning, has_no_occasion_in_format_2) {
  resign(take_, "cap01", cap01_, [](TakeSignature& signature) { signature.format = 2; });
  EXPECT_THAT(read_file(signature_file()), Not(HasSubstr("occasion")));
  EXPECT_EQ(check().signers.at(0).occasion, SigningOccasion::kUnknown);
  EXPECT_TRUE(check().is_complete);
}

TEST_F(TakeSigning, stops_reading_when_it_may_not_continue) {
  int reads = 0;
  const auto stopped = read_signature(take_, {"cap01", cap01_}, SigningOccasion::kRecovery,
                                      [&] { return ++reads < 3; });
  ASSERT_FALSE(stopped);
  EXPECT_EQ(stopped.error().code, ECANCELED);
  EXPECT_EQ(reads, 3);
}

TEST_F(TakeSigning, is_rejected_when_any_byte_of_a_file_is_changed) {
  for (const fs::path& file :
       {take_.frames("cam01"), take_.pulses(), take_.calib(), take_.background() / "cam02.toml"}) {
    const std::string content = read_file(file);
    for (size_t at = 0; at < content.size(); at += std::max<size_t>(1, content.size() / 40)) {
      std::string changed = content;
      changed[at] = static_cast<char>(changed[at] ^ 4);
      test::write_text(file, changed);
      const std::string name = file.lexically_relative(take_.folder);
      EXPECT_THAT(check().disagreements,
                  ElementsAre(name + ": does not match the signature of cap01"))
          << at;
    }
    test::write_text(file, content);
  }
  EXPECT_THAT(check().disagreements, IsEmpty());
}

TEST_F(TakeSigning, is_rejected_when_frames_are_reordered_repeated_or_removed) {
  const std::string content = read_file(take_.frames("cam01"));
  const size_t event = content.size() / kPulses;
  const std::string first = content.substr(0, event), second = content.substr(event, event);
  for (const std::string& other :
       {second + first + content.substr(2 * event), first + first + content.substr(2 * event),
        content + first, content.substr(event)}) {
    test::write_text(take_.frames("cam01"), other);
    EXPECT_THAT(check().disagreements,
                ElementsAre("cam01.lcmlog: does not match the signature of cap01"));
  }
}

TEST_F(TakeSigning, reports_missing_and_unsigned_files) {
  fs::remove(take_.calib());
  EXPECT_THAT(check().disagreements,
              ElementsAre("calib.toml: missing; the signature of cap01 names it"));
  test::write_text(take_.folder / "cam09.lcmlog", "");
  EXPECT_THAT(check().notes, ElementsAre("without a signature: cam09.lcmlog"));
}

TEST_F(TakeSigning, stays_valid_after_changes_of_slate_meshes_and_verification) {
  test::write_text(take_.slate(), "mark = 'circled'\n");
  test::write_text(take_.mesh(), "meshes");
  test::write_text(take_.verified(), "verdict = ''\n");
  test::write_text(take_.folder / "skeleton.json", "{}");
  EXPECT_THAT(check().disagreements, IsEmpty());
  EXPECT_THAT(check().notes, IsEmpty());
  EXPECT_TRUE(check().is_complete);
}

TEST_F(TakeSigning, stays_valid_when_a_skeleton_is_replaced_that_an_earlier_version_signed) {
  test::write_text(take_.folder / "skeleton.json", "{}");
  resign(take_, "cap01", cap01_, [](TakeSignature& signature) {
    signature.files.push_back({.name = "skeleton.json", .bytes = 9, .checksum = {}});
  });
  EXPECT_THAT(check().disagreements, IsEmpty());
}

TEST_F(TakeSigning, is_rejected_when_any_byte_of_the_signature_is_changed) {
  const std::string text = read_file(signature_file());
  for (size_t at = 0; at < text.size(); ++at) {
    std::string changed = text;
    changed[at] = static_cast<char>(changed[at] ^ 1);
    EXPECT_THAT(error_message(changed), HasSubstr(signature_file().string())) << at;
  }
  test::write_text(signature_file(), text + "\n");
  EXPECT_THAT(check().disagreements, ElementsAre(HasSubstr("its signature is wrong")));
  EXPECT_THAT(check().signers, IsEmpty());
  EXPECT_FALSE(check().is_complete);
}

TEST_F(TakeSigning, is_rejected_when_another_key_signed_it) {
  ASSERT_TRUE(sign_whole("cap01", wire::SigningKey::make()));
  EXPECT_THAT(check().disagreements, ElementsAre(HasSubstr("the studio file has")));
  EXPECT_FALSE(check().is_complete);
  studio_.nodes[0].public_key.clear();
  EXPECT_THAT(check().disagreements, IsEmpty());
  EXPECT_THAT(check().notes, ElementsAre(HasSubstr("which the studio file does not list")));
  EXPECT_FALSE(check().is_complete) << "the key is unknown";
}

TEST_F(TakeSigning, is_rejected_when_the_signer_does_not_own_the_camera) {
  fs::remove(signature_file());
  ASSERT_TRUE(sign_whole("cap02", cap02_));
  EXPECT_THAT(check().disagreements,
              Contains("cam01.lcmlog: was signed by cap02, but its camera belongs to cap01"));
  EXPECT_THAT(check().notes, Contains(HasSubstr("no signature of cap01")));
}

TEST_F(TakeSigning, is_rejected_with_the_signature_of_another_take_or_node) {
  fs::copy_file(signature_file(), take_.folder / "signature.cap02.toml");
  EXPECT_THAT(check().disagreements,
              ElementsAre("signature.cap02.toml: is the signature of node cap01"));
  fs::remove(take_.folder / "signature.cap02.toml");
  change(take_.info(), "name = 'kendo-07'", "name = 'kendo-08'");
  EXPECT_THAT(check().disagreements,
              ElementsAre("signature.cap01.toml: is of another take, kendo-07 of dojo"));
}

TEST_F(TakeSigning, reports_a_removed_signature) {
  fs::remove(signature_file());
  EXPECT_THAT(check().notes,
              ElementsAre("no signature of cap01, for which the studio file has a key"));
  EXPECT_FALSE(check().is_complete);
  EXPECT_FALSE(check_signatures(take_, nullptr).is_complete);
}

TEST_F(TakeSigning, stays_signed_by_all_nodes_after_join) {
  const TakePaths whole = joined_take();
  const SignatureCheck found = check(whole);
  EXPECT_THAT(found.disagreements, IsEmpty());
  EXPECT_THAT(found.notes, IsEmpty());
  EXPECT_THAT(found.signers, SizeIs(2));
  EXPECT_TRUE(found.is_complete);
  fs::remove(whole.folder / "signature.cap02.toml");
  EXPECT_FALSE(check(whole).is_complete);
  EXPECT_THAT(check(whole).notes,
              Contains("without a signature: background/cam03.toml, cam03.lcmlog"));
}
TEST_F(TakeSigning, fails_with_a_cause_for_a_take_without_a_ledger_or_with_a_damaged_take_toml) {
  for (const fs::path& file : {take_.info(), take_.ledger()}) {
    const std::string content = read_file(file);
    test::write_text(file, "damaged");
    for (const io::Status& done :
         {sign_take(take_, {"cap01", cap01_}, {}), sign_whole("cap01", cap01_)}) {
      ASSERT_FALSE(done);
      EXPECT_THAT(done.error().message,
                  AllOf(HasSubstr("cannot sign " + take_.folder.string()),
                        HasSubstr(file.filename().string()), Not(HasSubstr("\n"))));
    }
    test::write_text(file, content);
  }
}

TEST_F(TakeSigning, asks_for_each_mebibyte_of_sound_whether_to_continue) {
  fs::create_directory(take_.sound());
  test::write_text(take_.sound() / "cap01.wav", std::string(4 << 20, 's'));
  int calls = 0;
  const auto count = [&] { return ++calls > 0; };
  ASSERT_TRUE(sign_take(take_, {"cap01", cap01_}, {}, count));
  EXPECT_GE(calls, 4);
  EXPECT_FALSE(sign_take(take_, {"cap01", cap01_}, {}, [] { return false; }));
}

/// The state after a restart of the daemon in the take.
TEST_F(TakeSigning, reports_a_log_that_is_signed_by_its_length_only) {
  ASSERT_TRUE(sign_take(take_, {"cap01", cap01_}, {}));
  EXPECT_THAT(check().notes,
              ElementsAre(HasSubstr("cam01.lcmlog: only its length is signed by cap01"),
                          HasSubstr("cam02.lcmlog: only its length is signed by cap01")));
  EXPECT_THAT(check().disagreements, IsEmpty());
  fs::resize_file(take_.frames("cam01"), 100);
  EXPECT_THAT(check().disagreements,
              ElementsAre("cam01.lcmlog: does not match the signature of cap01"));
}

/// An attacker signs changed files with another key.
TEST_F(TakeSigning, is_rejected_when_a_stranger_signed_a_changed_file) {
  for (const fs::path& file : {take_.frames("cam01"), take_.pulses(), take_.calib()}) {
    const std::string content = read_file(file);
    test::write_text(file, content + "x");
    ASSERT_TRUE(sign_whole("stranger", wire::SigningKey::make()));
    const std::string name = file.filename();
    EXPECT_THAT(check().disagreements,
                ElementsAre(name + ": does not match the signature of cap01"));
    EXPECT_FALSE(check().is_complete);
    test::write_text(file, content);
  }
}

TEST_F(TakeSigning, is_not_complete_with_a_file_that_only_a_stranger_signed) {
  test::write_text(take_.folder / "cam09.lcmlog", "frames");
  EXPECT_FALSE(check().is_complete);
  ASSERT_TRUE(sign_whole("stranger", wire::SigningKey::make()));
  EXPECT_THAT(check().disagreements, IsEmpty());
  EXPECT_FALSE(check().is_complete);
  fs::remove(take_.folder / "cam09.lcmlog");
  fs::remove(take_.folder / "signature.stranger.toml");
  EXPECT_TRUE(check().is_complete);
}

TEST_F(TakeSigning, accepts_plates_and_logs_only_from_the_node_of_the_camera) {
  ASSERT_TRUE(sign_whole("cap02", cap02_));
  EXPECT_THAT(check().disagreements, IsEmpty()) << "both signed the same files";
  test::write_text(take_.background() / "cam01.toml", "another plate");
  ASSERT_TRUE(sign_whole("cap02", cap02_));
  EXPECT_THAT(check().disagreements,
              ElementsAre("background/cam01.toml: does not match the signature of cap01"));
}

/// Names of cameras may have dots: "ring.01" is not a file of the camera "ring".
TEST_F(TakeSigning, finds_the_node_of_a_camera_with_a_dot_in_its_name) {
  add_camera("ring", "cap02");
  add_camera("ring.01", "cap01");
  record("cap01", {"ring", "ring.01"}, cap01_);
  studio_.cameras[3].node = "cap01";
  EXPECT_THAT(check().disagreements, IsEmpty());
  studio_.cameras[3].node = "cap02";
  EXPECT_THAT(
      check().disagreements,
      ElementsAre("background/ring.toml: was signed by cap01, but its camera belongs to cap02",
                  "ring.lcmlog: was signed by cap01, but its camera belongs to cap02"));
  studio_.cameras[3].node = "cap01";
  test::write_text(take_.background() / "ring.01.toml", "another plate");
  ASSERT_TRUE(sign_whole("cap02", cap02_));
  EXPECT_THAT(check().disagreements,
              ElementsAre("background/ring.01.toml: does not match the signature of cap01"));
}

TEST_F(TakeSigning, reads_no_file_outside_the_take) {
  test::write_text(folder_ / "outside", "secret");
  for (const std::string& name : {std::string("../outside"), (folder_ / "outside").string()}) {
    // The signature is valid: the attacker has a known key.
    ASSERT_TRUE(sign_whole("cap01", cap01_));
    TakeSignature signature = parse_signature(read_file(signature_file()), signature_file());
    signature.files.push_back({.name = name, .bytes = 6, .checksum = {}});
    ASSERT_TRUE(save_signature(take_, signature, cap01_));
    EXPECT_THAT(check().disagreements,
                ElementsAre(name + ": missing; the signature of cap01 names it"));
  }
}

TEST_F(TakeSigning, is_rejected_with_another_rate_or_number_of_pulses) {
  TakeInfo info = load_take_info(take_);
  info.pulses = kPulses - 1;
  ASSERT_TRUE(save_take_info(take_, info));
  EXPECT_THAT(check().disagreements, ElementsAre("take.toml: has 2 pulses, the signatures have 3"));
  info.pulses = kPulses;
  info.rate_hz = 50;
  ASSERT_TRUE(save_take_info(take_, info));
  EXPECT_THAT(check().disagreements,
              ElementsAre("signature.cap01.toml: has another pulse rate than take.toml"));
}

TEST_F(TakeSigning, is_not_complete_when_a_log_is_signed_by_its_length_only) {
  ASSERT_TRUE(sign_take(take_, {"cap01", cap01_}, {}));
  EXPECT_FALSE(check().is_complete);
  ASSERT_TRUE(sign_whole("cap01", cap01_));
  EXPECT_TRUE(check().is_complete);
}

TEST_F(TakeSigning, covers_a_damaged_log) {
  std::string content = read_file(take_.frames("cam02"));
  content.insert(content.size() / 2, std::string(3 << 20, 'x'));
  test::write_text(take_.frames("cam02"), content);
  ASSERT_TRUE(sign_whole("cap01", cap01_));
  EXPECT_THAT(check().disagreements, IsEmpty());
  content.back() = static_cast<char>(content.back() ^ 1);
  test::write_text(take_.frames("cam02"), content);
  EXPECT_THAT(check().disagreements,
              ElementsAre("cam02.lcmlog: does not match the signature of cap01"));
}

TEST_F(TakeSigning, is_rejected_in_one_line_when_its_signature_is_unreadable) {
  for (const std::string& text :
       {std::string(), std::string("signature = "), std::string("signature = 'ab'\n"),
        std::string("x\n"), "signature = '" + std::string(128, 'a') + "'\nformat = 2\n"}) {
    EXPECT_THAT(error_message(text),
                AllOf(HasSubstr(signature_file().string()), Not(HasSubstr("\n"))))
        << text;
  }
  fs::remove(signature_file());
  fs::create_symlink("/etc/passwd", signature_file());
  EXPECT_THAT(check().disagreements, ElementsAre(HasSubstr("symbolic link")));
}

}  // namespace
}  // namespace v3d::take
