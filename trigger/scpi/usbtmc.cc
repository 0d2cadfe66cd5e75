#include "trigger/scpi/usbtmc.h"

#include <algorithm>
#include <utility>
#include <vector>

namespace v3d::trigger {
namespace {

constexpr Duration kTimeout = std::chrono::seconds(1);
constexpr size_t kTransfer = 4096;
/// Longer than any answer to the queries of this project.
constexpr size_t kMaxAnswerBytes = 16'384;
constexpr int kMaxParts = 64;
constexpr int kMaxChecks = 20;
constexpr uint8_t kStatusSuccess = 1;
constexpr uint8_t kStatusPending = 2;

}  // namespace

Usbtmc::Usbtmc(std::unique_ptr<UsbPort> port) : port_(std::move(port)) {
  initiate_and_wait(UsbtmcRequest::kClear, UsbtmcRequest::kCheckClear, 0);
  port_->clear_stalls();
}

uint8_t Usbtmc::next_tag() {
  tag_ = tag_ == 255 ? 1 : static_cast<uint8_t>(tag_ + 1);
  return tag_;
}

void Usbtmc::write(const std::string& line) {
  const UsbOutcome outcome = port_->send(usbtmc_out(next_tag(), line + "\n"), kTimeout);
  if (outcome != UsbOutcome::kDone) {
    fail(outcome, UsbtmcRequest::kAbortOut, UsbtmcRequest::kCheckAbortOut);
  }
}

std::string Usbtmc::query(const std::string& line) {
  write(line);
  std::string answer = read();
  while (!answer.empty() && (answer.back() == '\n' || answer.back() == '\r')) answer.pop_back();
  return answer;
}

std::string Usbtmc::read() {
  std::string text;
  for (int parts = 0; parts < kMaxParts; ++parts) {
    if (read_part(text)) return text;
    if (text.size() > kMaxAnswerBytes) break;
  }
  fail_protocol("the answer has no end");
}

bool Usbtmc::read_part(std::string& text) {
  const uint8_t tag = next_tag();
  const UsbOutcome request_outcome = port_->send(usbtmc_request(tag, kTransfer), kTimeout);
  if (request_outcome != UsbOutcome::kDone) {
    fail(request_outcome, UsbtmcRequest::kAbortOut, UsbtmcRequest::kCheckAbortOut);
  }
  std::vector<uint8_t> bytes;
  receive(bytes);
  const auto in = parse_usbtmc_in(bytes, tag);
  if (!in || in->size > kTransfer) fail_protocol("a wrong USBTMC header");
  text += in->text;
  for (size_t left = in->size - in->text.size(); left > 0;) {
    receive(bytes);
    if (bytes.empty()) fail_protocol("fewer bytes than announced");
    const size_t here = std::min(left, bytes.size());
    text.append(bytes.begin(), bytes.begin() + static_cast<ptrdiff_t>(here));
    left -= here;
  }
  return in->end;
}

void Usbtmc::receive(std::vector<uint8_t>& bytes) {
  bytes.assign(kTransfer + 512, 0);
  const UsbOutcome outcome = port_->receive(bytes, kTimeout);
  if (outcome != UsbOutcome::kDone) {
    fail(outcome, UsbtmcRequest::kAbortIn, UsbtmcRequest::kCheckAbortIn);
  }
}

void Usbtmc::initiate_and_wait(UsbtmcRequest initiate, UsbtmcRequest check, uint16_t value) {
  uint8_t status = 0;
  if (port_->request(initiate, value, status) != UsbOutcome::kDone) return;
  if (status != kStatusSuccess) return;
  for (int i = 0; i < kMaxChecks; ++i) {
    if (port_->request(check, 0, status) != UsbOutcome::kDone || status != kStatusPending) return;
  }
}

void Usbtmc::fail(UsbOutcome outcome, UsbtmcRequest abort, UsbtmcRequest check) {
  switch (outcome) {
    case UsbOutcome::kGone:
      throw InstrumentAbsent("was unplugged");
    case UsbOutcome::kTimeout:
      initiate_and_wait(abort, check, tag_);
      initiate_and_wait(UsbtmcRequest::kClear, UsbtmcRequest::kCheckClear, 0);
      port_->clear_stalls();
      throw InstrumentError("does not answer");
    case UsbOutcome::kStall:
      port_->clear_stalls();
      initiate_and_wait(UsbtmcRequest::kClear, UsbtmcRequest::kCheckClear, 0);
      port_->clear_stalls();
      throw InstrumentError("rejects a transfer (STALL)");
    default:
      throw InstrumentError("USB transfer failed");
  }
}

void Usbtmc::fail_protocol(const std::string& what) {
  initiate_and_wait(UsbtmcRequest::kClear, UsbtmcRequest::kCheckClear, 0);
  port_->clear_stalls();
  throw InstrumentError("sends invalid data: " + what);
}

namespace {

constexpr uint8_t kMessageOut = 1;
constexpr uint8_t kMessageIn = 2;  // request and answer
constexpr uint8_t kEndOfMessage = 1;

/// A header, followed by `body` zero bytes.
std::vector<uint8_t> message(uint8_t kind, uint8_t tag, size_t size, uint8_t attributes,
                             size_t body) {
  std::vector<uint8_t> bytes(kUsbtmcHeader + body, 0);
  bytes[0] = kind;
  bytes[1] = tag;
  bytes[2] = static_cast<uint8_t>(~tag);
  for (size_t i = 0; i < 4; ++i) bytes[4 + i] = static_cast<uint8_t>(size >> (8 * i));
  bytes[8] = attributes;
  return bytes;
}

}  // namespace

std::vector<uint8_t> usbtmc_out(uint8_t tag, std::string_view text) {
  const size_t padded = (text.size() + 3) / 4 * 4;
  std::vector<uint8_t> bytes = message(kMessageOut, tag, text.size(), kEndOfMessage, padded);
  std::copy(text.begin(), text.end(), bytes.begin() + kUsbtmcHeader);
  return bytes;
}

std::vector<uint8_t> usbtmc_request(uint8_t tag, uint32_t max_bytes) {
  return message(kMessageIn, tag, max_bytes, 0, 0);
}

std::optional<UsbtmcIn> parse_usbtmc_in(std::span<const uint8_t> transfer, uint8_t tag) {
  if (transfer.size() < kUsbtmcHeader || transfer[0] != kMessageIn || transfer[1] != tag ||
      transfer[2] != static_cast<uint8_t>(~tag)) {
    return {};
  }
  UsbtmcIn in;
  for (size_t i = 0; i < 4; ++i) in.size |= static_cast<uint32_t>(transfer[4 + i]) << (8 * i);
  in.end = (transfer[8] & kEndOfMessage) != 0;
  const auto text = transfer.subspan(kUsbtmcHeader);
  in.text = {reinterpret_cast<const char*>(text.data()), std::min<size_t>(text.size(), in.size)};
  return in;
}

}  // namespace v3d::trigger
