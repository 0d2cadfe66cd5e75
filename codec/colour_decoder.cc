#include <utility>

#include "codec/byte_stream.h"
#include "codec/colour_code.h"
#include "codec/colour_model.h"
#include "codec/entropy_coder.h"

namespace v3d::codec {
namespace {

class ColourDecoder {
 public:
  ColourDecoder(std::span<const uint8_t> head, std::span<const uint8_t> symbols,
                const KnownVertices& known, const ColourSteps& steps,
                const PreviousColours* previous)
      : head_(head),
        symbols_(symbols),
        known_(known),
        steps_(steps),
        previous_(previous),
        contexts_(steps) {
    for (uint32_t symbol = 0; symbol < kSymbols; ++symbol) {
      bool escape = false;
      for (int n = 0; n < 3; ++n) {
        const int residual = ColourSymbol::residual(symbol, n);
        moves_[symbol][n] = static_cast<int16_t>(residual * steps[n]);
        escape = escape || ColourSymbol::is_escape(residual, n);
      }
      moves_[symbol][3] = static_cast<int16_t>(escape);
    }
  }

  /// False when the bytes are not the output of an encoder.
  bool run() {
    if (!read_tables() || !read_groups()) return false;
    decoded_.resize(known_.vertices());
    if (!decoded_.empty()) decoded_[0] = kFirstColour;
    for (uint32_t first = 0; first < known_.vertices(); first += kColourGroup) {
      const uint32_t end = std::min(first + kColourGroup, known_.vertices());
      groups_[first / kColourGroup] ? decode<true>(first, end) : decode<false>(first, end);
      if (!valid_ || head_.overran()) return false;
    }
    return head_.ended() && symbols_.ended();
  }
  std::vector<LumaChroma>& decoded() { return decoded_; }

 private:
  bool read_tables();
  bool read_groups();
  template <bool kFromPrevious>
  void decode(uint32_t first, uint32_t end);
  LumaChroma decode_escape(uint32_t entry, const LumaChroma& prediction);

  RangeDecoder head_;
  RansDecoder symbols_;
  const KnownVertices& known_;
  const ColourSteps& steps_;
  const PreviousColours* const previous_;
  const ColourContexts contexts_;
  /// [symbol]: residuals times steps; the fourth is 1 when one of them is an escape.
  std::array<LumaChroma, kSymbols> moves_{};
  std::vector<SlotTable> tables_ = std::vector<SlotTable>(ColourContexts::kCount);
  std::vector<bool> groups_;  ///< [group]: predicted from the previous frame
  EscapeModel escape_model_;
  bool valid_ = true;
  std::vector<LumaChroma> decoded_;
};

bool ColourDecoder::read_tables() {
  SlotsModel model;
  for (SlotTable& table : tables_) {
    SymbolSlots slots{};
    if (!model.code(head_, slots) || head_.overran()) return false;
    fill(slots, table);
  }
  return true;
}

bool ColourDecoder::read_groups() {
  BitModel model;
  for (uint32_t first = 0; first < known_.vertices(); first += kColourGroup) {
    groups_.push_back(previous_ != nullptr && head_.bit(model));
    if (head_.overran()) return false;
  }
  return true;
}

template <bool kFromPrevious>
void ColourDecoder::decode(uint32_t first, uint32_t end) {
  RansDecoder in_registers = symbols_;
  LumaChroma* const decoded = decoded_.data();
  for (uint32_t vertex = first; vertex < end; ++vertex) {
    ColourPrediction prediction = predict_from(known_.of(vertex), decoded);
    uint32_t table = contexts_.of(prediction.spread);
    if constexpr (kFromPrevious) {
      if (const LumaChroma* previous = previous_->at(vertex)) {
        prediction.mean = lanes_of(*previous);
        table = ColourContexts::kPrevious;
      }
    }
    const uint32_t entry = tables_[table][in_registers.slot()];
    in_registers.take(slots_in(entry), place_in(entry));
    const LumaChroma& move = moves_[symbol_in(entry)];
    decoded[vertex] = clamped(prediction.mean + lanes_of(move));
    if (move[3] != 0) [[unlikely]]
      decoded[vertex] = decode_escape(entry, colour_in(prediction.mean));
  }
  symbols_ = in_registers;
}

[[gnu::noinline]] LumaChroma ColourDecoder::decode_escape(uint32_t entry,
                                                          const LumaChroma& prediction) {
  valid_ = valid_ && entry != kNoSymbol;
  LumaChroma colour{};
  for (int n = 0; n < 3; ++n) {
    int residual = ColourSymbol::residual(symbol_in(entry), n);
    if (ColourSymbol::is_escape(residual, n)) residual = escape_model_.code(head_, n, 0);
    colour[n] = dequantised(prediction[n], residual, steps_[n], n);
  }
  return colour;
}

}  // namespace

std::optional<std::vector<LumaChroma>> decode_colours(std::span<const uint8_t> bytes,
                                                      const KnownVertices& known,
                                                      const ColourSteps& steps,
                                                      const PreviousColours* previous) {
  if (bytes.size() < sizeof(uint32_t)) return std::nullopt;
  const auto head = ByteReader(bytes).number<uint32_t>();
  bytes = bytes.subspan(sizeof(head));
  if (head > bytes.size()) return std::nullopt;
  ColourDecoder decoder(bytes.first(head), bytes.subspan(head), known, steps, previous);
  if (!decoder.run()) return std::nullopt;
  return std::move(decoder.decoded());
}

LumaChroma luma_chroma_of(const VertexColour& colour) {
  const int co = colour[0] - colour[2];
  const int middle = colour[2] + (co >> 1);
  const int cg = colour[1] - middle;
  return {static_cast<int16_t>(middle + (cg >> 1)), static_cast<int16_t>(co),
          static_cast<int16_t>(cg), 0};
}

}  // namespace v3d::codec
