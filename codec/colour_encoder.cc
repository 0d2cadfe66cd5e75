#include <utility>

#include "codec/byte_stream.h"
#include "codec/check.h"
#include "codec/colour_code.h"
#include "codec/colour_model.h"
#include "codec/entropy_coder.h"

namespace v3d::codec {
namespace {

/// The choice of the prediction of a group examines every fourth vertex.
constexpr uint32_t kSampleStride = 4;

/// Differences of colours in steps. A table, because a division takes longer.
class Quantiser {
 public:
  explicit Quantiser(const ColourSteps& steps) {
    for (size_t n = 0; n < steps.size(); ++n) {
      for (int difference = -kReach; difference <= kReach; ++difference) {
        const int residual = nearest(difference, steps[n]);
        entries_[n][kReach + difference] = {static_cast<int16_t>(residual),
                                            static_cast<int16_t>(residual * steps[n])};
      }
    }
  }

  /// The nearest number of steps; of two, the smaller one: a colour that is within half a step of
  /// the previous frame keeps its value.
  int residual(int difference, size_t n) const { return entries_[n][kReach + difference].residual; }
  /// The difference that the decoder computes from this residual.
  int16_t rounded(int difference, size_t n) const {
    return entries_[n][kReach + difference].rounded;
  }

 private:
  static constexpr int kReach = 510;  ///< the largest difference of two colours
  struct Entry {
    int16_t residual, rounded;
  };

  static int nearest(int difference, int step) {
    const int half = (step - 1) / 2;
    return difference < 0 ? -((half - difference) / step) : (difference + half) / step;
  }

  std::array<std::array<Entry, 2 * kReach + 1>, 3> entries_{};
};

class ColourEncoder {
 public:
  ColourEncoder(std::span<const LumaChroma> wanted, const KnownVertices& known,
                const ColourSteps& steps, const PreviousColours* previous)
      : wanted_(wanted), known_(known), previous_(previous), quantiser_(steps), contexts_(steps) {}

  CodedColours run() {
    for (uint32_t first = 0; first < wanted_.size(); first += kColourGroup) {
      groups_.push_back(previous_ != nullptr && previous_is_closer(first));
    }
    decoded_.resize(wanted_.size());
    symbols_.reserve(wanted_.size());
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
  struct Escape {
    int n;  ///< 0 luma, 1 Co, 2 Cg
    int residual;
  };

  bool previous_is_closer(uint32_t vertex) const;
  void add(uint32_t vertex);
  std::vector<uint8_t> write_head();
  void write_symbols(ByteWriter& bytes) const;

  std::span<const LumaChroma> wanted_;
  const KnownVertices& known_;
  const PreviousColours* const previous_;
  const Quantiser quantiser_;
  const ColourContexts contexts_;
  std::vector<bool> groups_;  ///< [group]: predict from the previous frame
  std::vector<LumaChroma> decoded_;
  std::vector<Symbol> symbols_;
  std::vector<Escape> escapes_;
  std::array<SymbolCounts, ColourContexts::kCount> counts_{};
  std::array<SymbolSlots, ColourContexts::kCount> slots_{};
};

/// Compares the luma errors of both predictions for some vertices of the group that starts at
/// `vertex`, without quantisation.
bool ColourEncoder::previous_is_closer(uint32_t vertex) const {
  int64_t from_surface = 0, from_previous = 0;
  const auto end = static_cast<uint32_t>(std::min<size_t>(vertex + kColourGroup, wanted_.size()));
  for (; vertex < end; vertex += kSampleStride) {
    const LumaChroma* previous = previous_->at(vertex);
    if (previous == nullptr) continue;
    const LumaChroma prediction = colour_in(predict_from(known_.of(vertex), wanted_.data()).mean);
    from_surface += std::abs(wanted_[vertex][0] - prediction[0]);
    from_previous += std::abs(wanted_[vertex][0] - (*previous)[0]);
  }
  return 2 * from_previous < from_surface;  // the decoder is slower with the previous frame
}

void ColourEncoder::add(uint32_t vertex) {
  const ColourPrediction surface = predict_from(known_.of(vertex), decoded_.data());
  const LumaChroma* previous = groups_[vertex / kColourGroup] ? previous_->at(vertex) : nullptr;
  const Lanes prediction = previous != nullptr ? lanes_of(*previous) : surface.mean;
  const LumaChroma difference = colour_in(lanes_of(wanted_[vertex]) - prediction);
  std::array<int, 3> residuals;
  for (int n = 0; n < 3; ++n) {
    residuals[n] = quantiser_.residual(difference[n], n);
    if (ColourSymbol::is_escape(residuals[n], n)) escapes_.push_back({n, residuals[n]});
  }
  const Lanes rounded{quantiser_.rounded(difference[0], 0), quantiser_.rounded(difference[1], 1),
                      quantiser_.rounded(difference[2], 2), 0};
  decoded_[vertex] = clamped(prediction + rounded);
  const uint32_t table =
      previous != nullptr ? uint32_t{ColourContexts::kPrevious} : contexts_.of(surface.spread);
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
  BitModel from_previous;
  if (previous_ != nullptr) {
    for (const bool group : groups_) coder.bit(from_previous, group);
  }
  EscapeModel model;
  for (const auto& [n, residual] : escapes_) model.code(coder, n, residual);
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
                            const ColourSteps& steps, const PreviousColours* previous) {
  V3D_CODEC_CHECK(colours.size() == known.vertices());
  return ColourEncoder(colours, known, steps, previous).run();
}

}  // namespace v3d::codec
