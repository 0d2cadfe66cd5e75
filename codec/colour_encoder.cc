#include <cassert>
#include <utility>

#include "codec/byte_stream.h"
#include "codec/colour_code.h"
#include "codec/colour_model.h"
#include "codec/rans.h"
#include "codec/symbol_table.h"

namespace v3d {
namespace {

constexpr uint32_t kSample = 4;  // of a group the encoder looks at one in so many to decide

/// To the nearest whole number of steps, halves towards 0: what has not changed since the frame
/// before is not touched again.
int steps_in(int difference, int step) {
  const int half = (step - 1) / 2;
  return difference < 0 ? -((half - difference) / step) : (difference + half) / step;
}

class ColourEncoder {
 public:
  ColourEncoder(std::span<const LumaChroma> wanted, const KnownVertices& known,
                const ColourSteps& steps, const FormerColours* former)
      : wanted_(wanted), known_(known), steps_(steps), former_(former), contexts_(steps) {}

  CodedColours run() {
    for (uint32_t first = 0; first < wanted_.size(); first += kColourGroup) {
      groups_.push_back(former_ != nullptr && former_is_nearer(first));
    }
    decoded_.resize(wanted_.size());
    if (!decoded_.empty()) decoded_[0] = kFirstColour;
    for (uint32_t vertex = 0; vertex < wanted_.size(); ++vertex) add(vertex);
    ByteWriter bytes;
    const std::vector<uint8_t> head = write_head();
    bytes.number(static_cast<uint32_t>(head.size()));
    bytes.bytes(head);
    write_symbols(bytes);
    return {bytes.take(), std::move(decoded_)};
  }

 private:
  struct Symbol {
    uint8_t table;
    uint8_t symbol;
  };
  struct Beyond {
    int n;  ///< of luma, Co and Cg
    int residual;
  };

  bool former_is_nearer(uint32_t vertex) const;
  void add(uint32_t vertex);
  std::vector<uint8_t> write_head();
  void write_symbols(ByteWriter& bytes) const;

  std::span<const LumaChroma> wanted_;
  const KnownVertices& known_;
  const ColourSteps& steps_;
  const FormerColours* const former_;
  const ColourContexts contexts_;
  std::vector<bool> groups_;  ///< from the frame before
  std::vector<LumaChroma> decoded_;
  std::vector<Symbol> symbols_;
  std::vector<Beyond> beyond_;
  std::array<SymbolCounts, ColourContexts::kCount> counts_{};
  std::array<SymbolSlots, ColourContexts::kCount> slots_{};
};

/// By luma of some of the group that begins at `vertex`, as if nothing were quantised.
bool ColourEncoder::former_is_nearer(uint32_t vertex) const {
  int64_t from_surface = 0, from_former = 0;
  const auto end = static_cast<uint32_t>(std::min<size_t>(vertex + kColourGroup, wanted_.size()));
  for (; vertex < end; vertex += kSample) {
    const LumaChroma* former = former_->at(vertex);
    if (former == nullptr) continue;
    const LumaChroma guess = colour_in(guess_from(known_.of(vertex), wanted_.data()).mean);
    from_surface += std::abs(wanted_[vertex][0] - guess[0]);
    from_former += std::abs(wanted_[vertex][0] - (*former)[0]);
  }
  return 2 * from_former < from_surface;  // looking there costs the decoder time
}

void ColourEncoder::add(uint32_t vertex) {
  const ColourGuess surface = guess_from(known_.of(vertex), decoded_.data());
  const LumaChroma* former = groups_[vertex / kColourGroup] ? former_->at(vertex) : nullptr;
  const LumaChroma guess = former != nullptr ? *former : colour_in(surface.mean);
  std::array<int, 3> residuals;
  for (int n = 0; n < 3; ++n) {
    residuals[n] = steps_in(wanted_[vertex][n] - guess[n], steps_[n]);
    if (ColourSymbol::is_beyond(residuals[n], n)) beyond_.push_back({n, residuals[n]});
    decoded_[vertex][n] = stepped(guess[n], residuals[n], steps_[n], n);
  }
  const uint32_t table =
      former != nullptr ? uint32_t{ColourContexts::kFormer} : contexts_.of(surface.spread);
  const uint32_t symbol = ColourSymbol::of(residuals);
  symbols_.push_back({static_cast<uint8_t>(table), static_cast<uint8_t>(symbol)});
  ++counts_[table][symbol];
}

std::vector<uint8_t> ColourEncoder::write_head() {
  RangeEncoder coder;
  SlotsModel tables;
  for (size_t table = 0; table < counts_.size(); ++table) {
    slots_[table] = slots_of(counts_[table]);
    tables.code(coder, slots_[table]);
  }
  BitModel from_former;
  if (former_ != nullptr) {
    for (const bool group : groups_) coder.bit(from_former, group);
  }
  BeyondModel model;
  for (const auto& [n, residual] : beyond_) model.code(coder, n, residual);
  return coder.take();
}

void ColourEncoder::write_symbols(ByteWriter& bytes) const {
  std::array<SymbolSlots, ColourContexts::kCount> first;
  for (size_t table = 0; table < first.size(); ++table) first[table] = first_slots(slots_[table]);
  RansEncoder coder;
  for (size_t n = symbols_.size(); n-- > 0;) {
    const auto [table, symbol] = symbols_[n];
    coder.put(first[table][symbol], slots_[table][symbol]);
  }
  coder.finish(bytes);
}

}  // namespace

CodedColours encode_colours(std::span<const LumaChroma> colours, const KnownVertices& known,
                            const ColourSteps& steps, const FormerColours* former) {
  assert(colours.size() == known.vertices());
  return ColourEncoder(colours, known, steps, former).run();
}

}  // namespace v3d
