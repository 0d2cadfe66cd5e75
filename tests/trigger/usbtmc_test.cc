#include "trigger/scpi/usbtmc.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <deque>

#include "support/message_of.h"

namespace v3d::trigger {
namespace {

using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;

/// Scripted results of the transfers, in order, and a record of the sent data.
struct Cable {
  struct Transfer {
    UsbOutcome outcome = UsbOutcome::kDone;
    std::vector<uint8_t> bytes;
  };
  std::deque<Transfer> answers;
  std::deque<UsbOutcome> sends;  ///< empty: done
  std::vector<std::vector<uint8_t>> sent;
  std::vector<UsbtmcRequest> requests;
  std::deque<uint8_t> statuses;  ///< empty: success
  int stalls_cleared = 0;

  uint8_t tag() const { return sent.back()[1]; }
};

class ScriptedPort : public UsbPort {
 public:
  explicit ScriptedPort(Cable& cable) : cable_(cable) {}
  UsbOutcome send(std::span<const uint8_t> bytes, Duration /*timeout*/) override {
    cable_.sent.emplace_back(bytes.begin(), bytes.end());
    return take(cable_.sends, UsbOutcome::kDone);
  }
  UsbOutcome receive(std::vector<uint8_t>& bytes, Duration /*timeout*/) override {
    const auto transfer = take(cable_.answers, {UsbOutcome::kTimeout, {}});
    bytes = transfer.bytes;
    if (bytes.size() >= 3 && bytes[1] == 0) {  // tag 0: set the tag of the request
      bytes[1] = cable_.tag();
      bytes[2] = static_cast<uint8_t>(~cable_.tag());
    }
    return transfer.outcome;
  }
  UsbOutcome request(UsbtmcRequest request, uint16_t /*value*/, uint8_t& status) override {
    cable_.requests.push_back(request);
    status = take(cable_.statuses, uint8_t{1});
    return UsbOutcome::kDone;
  }
  void clear_stalls() override { ++cable_.stalls_cleared; }

 private:
  template <class T>
  static T take(std::deque<T>& from, T otherwise) {
    if (from.empty()) return otherwise;
    T first = from.front();
    from.pop_front();
    return first;
  }
  Cable& cable_;
};

/// DEV_DEP_MSG_IN with the tag of the request.
std::vector<uint8_t> answer(std::string_view text, uint32_t size, bool end) {
  std::vector<uint8_t> bytes(kUsbtmcHeader + text.size(), 0);
  bytes[0] = 2;
  bytes[4] = static_cast<uint8_t>(size);
  bytes[5] = static_cast<uint8_t>(size >> 8);
  bytes[8] = end ? 1 : 0;
  std::copy(text.begin(), text.end(), bytes.begin() + kUsbtmcHeader);
  return bytes;
}

Cable::Transfer done(std::vector<uint8_t> bytes) { return {UsbOutcome::kDone, std::move(bytes)}; }

struct Instrumented {
  Cable cable;
  Usbtmc instrument{std::make_unique<ScriptedPort>(cable)};
  Instrumented() {
    cable.requests.clear();
    cable.stalls_cleared = 0;
  }
  std::string refusal() {
    return test::message_of<InstrumentError>([&] { instrument.query("*IDN?"); });
  }
};

TEST(Usbtmc, clears_the_instrument_when_it_opens_it) {
  Cable cable;
  cable.statuses = {1, 2, 2, 1};
  const Usbtmc instrument(std::make_unique<ScriptedPort>(cable));
  EXPECT_THAT(cable.requests, ElementsAre(UsbtmcRequest::kClear, UsbtmcRequest::kCheckClear,
                                          UsbtmcRequest::kCheckClear, UsbtmcRequest::kCheckClear));
}

TEST(Usbtmc, pads_a_message_to_four_bytes_and_never_uses_tag_0) {
  Instrumented it;
  for (int i = 0; i < 600; ++i) {
    it.instrument.write("*RST2");
    const auto& bytes = it.cable.sent.back();
    ASSERT_EQ(bytes.size(), 20U);
    ASSERT_NE(bytes[1], 0);
    ASSERT_EQ(bytes[1] ^ bytes[2], 0xFF);
  }
  EXPECT_EQ(std::vector<uint8_t>(it.cable.sent[0].begin() + 4, it.cable.sent[0].end()),
            (std::vector<uint8_t>{6, 0, 0, 0, 1, 0, 0, 0, '*', 'R', 'S', 'T', '2', '\n', 0, 0}));
}

TEST(Usbtmc, joins_an_answer_from_transfers_and_from_messages) {
  Instrumented it;
  it.cable.answers = {done(answer("LAB,PUL", 12, false)), done({'S', 'E', 'G', 'E', 'N', 0, 0}),
                      done(answer(",1.0\n", 5, true))};
  EXPECT_EQ(it.instrument.query("*IDN?"), "LAB,PULSEGEN,1.0");
}

TEST(Usbtmc, aborts_a_transfer_after_a_timeout_and_recovers) {
  Instrumented it;
  EXPECT_EQ(it.refusal(), "does not answer");
  EXPECT_THAT(it.cable.requests, Contains(UsbtmcRequest::kAbortIn));
  EXPECT_THAT(it.cable.requests, Contains(UsbtmcRequest::kClear));
  it.cable.answers = {done(answer("ok\n", 3, true))};
  EXPECT_EQ(it.instrument.query("*IDN?"), "ok");
  it.cable.requests.clear();
  it.cable.sends = {UsbOutcome::kTimeout};
  EXPECT_EQ(it.refusal(), "does not answer");
  EXPECT_THAT(it.cable.requests, Contains(UsbtmcRequest::kAbortOut));
}

TEST(Usbtmc, clears_a_stall_and_recovers) {
  Instrumented it;
  it.cable.answers = {{UsbOutcome::kStall, {}}};
  EXPECT_THAT(it.refusal(), HasSubstr("STALL"));
  EXPECT_GE(it.cable.stalls_cleared, 1);
  it.cable.answers = {done(answer("ok\n", 3, true))};
  EXPECT_EQ(it.instrument.query("*IDN?"), "ok");
}

TEST(Usbtmc, reports_invalid_data_and_returns_for_every_input) {
  std::vector<uint8_t> huge = answer("x", 3, true);
  huge[7] = 0x7F;
  std::vector<uint8_t> other_tag = answer("x", 1, true);
  other_tag[1] = 77;
  for (const auto& bytes : {std::vector<uint8_t>{}, std::vector<uint8_t>{2, 0}, huge, other_tag,
                            std::vector<uint8_t>(512, 0xFF)}) {
    Instrumented it;
    it.cable.answers = {done(bytes)};
    EXPECT_THAT(it.refusal(), HasSubstr("sends invalid data"));
  }
  Instrumented it;
  for (int i = 0; i < 1000; ++i) it.cable.answers.push_back(done(answer("", 0, false)));
  EXPECT_THAT(it.refusal(), HasSubstr("has no end"));
  it.cable.answers = {done(answer("ab", 9, true)), done({})};
  EXPECT_THAT(it.refusal(), HasSubstr("fewer bytes than announced"));
}

TEST(Usbtmc, reports_that_the_instrument_was_unplugged) {
  Instrumented it;
  it.cable.sends = {UsbOutcome::kGone};
  EXPECT_EQ(it.refusal(), "was unplugged");
  it.cable.sends = {UsbOutcome::kDone, UsbOutcome::kDone};
  it.cable.answers = {{UsbOutcome::kGone, {}}};
  EXPECT_EQ(it.refusal(), "was unplugged");
}

}  // namespace
}  // namespace v3d::trigger
