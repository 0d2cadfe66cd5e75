// Fuzz target: the text files of a take, which may be damaged or written by hand. Any text is read
// or rejected with an InputError.
#include <string_view>

#include "base/core/error.h"
#include "take/ledger/ledger.h"
#include "take/ledger/take_account.h"
#include "take/take.h"
#include "take/take_listing.h"

namespace {

template <class Read>
void check(Read read) {
  try {
    read();
  } catch (const v3d::InputError&) {
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  check([&] { v3d::take::parse_take_info(text, "take.toml"); });
  check([&] { v3d::take::parse_slate(text, "slate.toml"); });
  check([&] { v3d::take::parse_verified(text, "verified.toml"); });
  check([&] {
    const v3d::take::Ledger ledger = v3d::take::parse_ledger(text, "ledger.toml");
    ledger.verdict();
    v3d::take::problem_lines(v3d::take::merge({ledger, ledger}));
  });
  return 0;
}
