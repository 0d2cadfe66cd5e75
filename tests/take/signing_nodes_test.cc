// Signatures of a take of several nodes: what they state about all of its nodes and cameras.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "signed_take.h"
#include "take/ledger/verify.h"

namespace v3d::take {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

class TakeOfSigningNodes : public test::SignedTake {};

TEST_F(TakeOfSigningNodes, names_the_capture_nodes_of_the_take_and_the_counts_of_its_own_cameras) {
  joined_take();
  const fs::path file = signature_path(part("cap02"), "cap02");
  const TakeSignature signature = parse_signature(read_file(file), file);
  const TakeNode cap01{"cap01", {"cam01", "cam02"}}, cap02{"cap02", {"cam03"}};
  EXPECT_THAT(signature.nodes, ElementsAre(cap01, cap02));
  EXPECT_THAT(signature.cameras,
              ElementsAre(SignedCamera{"cam03", test::kSignedPulses, test::kSignedPulses,
                                       test::kSignedPulses, 0}));
}

/// Removes all that cap02 recorded, and edits take.toml and ledger.toml so that they agree.
void remove_cap02(const TakePaths& whole) {
  for (const char* name : {"cam03.lcmlog", "background/cam03.toml", "signature.cap02.toml"}) {
    fs::remove(whole.folder / name);
  }
  TakeInfo info = load_take_info(whole);
  info.cameras = {"cam01", "cam02"};
  Ledger ledger = load_ledger(whole.ledger());
  ledger.cameras.pop_back();
  ledger.files.clear();
  save_account_or_throw(whole, info, ledger);
}

TEST_F(TakeOfSigningNodes, reveals_that_everything_of_a_node_was_removed) {
  const TakePaths whole = joined_take();
  remove_cap02(whole);
  ASSERT_TRUE(verify_take(whole).whole()) << "the edits agree with each other";
  EXPECT_FALSE(check(whole).is_complete);
  EXPECT_THAT(check(whole).notes,
              ElementsAre("no signature of cap02, for which the studio file has a key"));
  // The attacker also removes the studio file of the take: it is signed.
  fs::remove(whole.studio());
  EXPECT_FALSE(check(whole).is_complete);
}

TEST_F(TakeOfSigningNodes, of_the_part_of_one_node_is_not_the_signature_of_the_take) {
  joined_take();
  EXPECT_THAT(check(part("cap01")).disagreements, IsEmpty());
  EXPECT_FALSE(check(part("cap01")).is_complete);
}

TEST_F(TakeOfSigningNodes, of_format_1_is_read_and_does_not_prove_that_the_take_has_all_nodes) {
  const TakePaths whole = joined_take();
  const auto to_format_1 = [](TakeSignature& signature) {
    signature.format = 1;
    signature.nodes.clear();
    signature.cameras.clear();
  };
  resign(whole, "cap02", cap02_, to_format_1);
  EXPECT_THAT(check(whole).notes, ElementsAre(HasSubstr("signature.cap02.toml: has format 1")));
  EXPECT_TRUE(check(whole).is_complete) << "the signature of cap01 names all nodes";
  resign(whole, "cap01", cap01_, to_format_1);
  EXPECT_THAT(check(whole).disagreements, IsEmpty());
  EXPECT_THAT(check(whole).signers, SizeIs(2));
  EXPECT_EQ(check(whole).signers[0].files, 7);
  EXPECT_FALSE(check(whole).is_complete);
}

TEST_F(TakeOfSigningNodes, is_rejected_when_two_nodes_name_other_nodes_of_the_take) {
  const TakePaths whole = joined_take();
  resign(whole, "cap02", cap02_, [](TakeSignature& signature) { signature.nodes.pop_back(); });
  EXPECT_THAT(check(whole).disagreements,
              ElementsAre("signature.cap02.toml: names other nodes of the take than "
                          "signature.cap01.toml does"));
}

TEST_F(TakeOfSigningNodes, is_rejected_with_other_cameras_counts_or_state) {
  const TakePaths whole = joined_take();
  Ledger ledger = load_ledger(whole.ledger());
  ledger.cameras[2].exposed += 1;
  ASSERT_TRUE(save_ledger(whole.ledger(), ledger));
  EXPECT_THAT(check(whole).disagreements,
              ElementsAre("ledger.toml: its counts of frames of cam03 are not those of "
                          "signature.cap02.toml"));
  ledger.cameras[2].exposed -= 1;
  ASSERT_TRUE(save_ledger(whole.ledger(), ledger));
  TakeInfo info = load_take_info(whole);
  info.cameras.pop_back();
  ASSERT_TRUE(save_take_info(whole, info));
  EXPECT_THAT(check(whole).disagreements,
              ElementsAre("take.toml: has no camera cam03, which signature.cap02.toml names"));
  info.cameras.emplace_back("cam03");
  ASSERT_TRUE(save_take_info(whole, info));
  resign(whole, "cap01", cap01_,
         [](TakeSignature& signature) { signature.state = TakeState::kRecovered; });
  EXPECT_THAT(check(whole).disagreements,
              ElementsAre("take.toml: says complete, signature.cap01.toml recovered"));
}

}  // namespace
}  // namespace v3d::take
