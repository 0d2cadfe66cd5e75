#include "codec/connectivity_code.h"

#include <algorithm>
#include <bit>

#include "codec/check.h"
#include "codec/entropy_coder.h"

namespace v3d::codec {
namespace {

using Triangle = std::array<uint32_t, 3>;

constexpr uint32_t kNone = ~uint32_t{0};
/// Edges of a vertex that a search visits. It bounds the time for hostile bytes.
constexpr int kMaxSearched = 16;

/// An edge of a coded triangle. It is open until the triangle on its other side is coded.
struct Edge {
  uint32_t from = 0, to = 0;
  uint32_t older_out = kNone, older_in = kNone;  ///< earlier edge that leaves `from`, enters `to`
  bool open = true;
};

/// How the third corner of the next triangle is coded.
enum class Corner : uint8_t { kNew, kRight, kLeft, kKnown, kNoTriangle };

/// The border between coded and remaining triangles. Encoder and decoder have the same.
class Border {
 public:
  explicit Border(uint32_t vertices)
      : out_(vertices, kNone), in_(vertices, kNone), uses_(vertices) {}

  /// Number of vertices that have occurred.
  uint32_t known() const { return known_; }

  /// Adds a coded triangle. Requires corners of at most known(); known() itself is a new vertex.
  void add(const Triangle& corners) {
    for (int side = 0; side < 3; ++side) {
      const uint32_t from = corners[side];
      known_ = std::max(known_, from + 1);
      uses_[from] = static_cast<uint8_t>(std::min(uses_[from] + 1, kUses - 1));
    }
    for (int side = 0; side < 3; ++side) add_edge(corners[side], corners[(side + 1) % 3]);
  }

  /// The next open edge: the last one added. Null when there is none.
  const Edge* next_gate() {
    while (!gates_.empty() && !edges_[gates_.back()].open) gates_.pop_back();
    return gates_.empty() ? nullptr : &edges_[gates_.back()];
  }
  /// Closes the edge of next_gate(), which has no other triangle.
  void close_gate() { edges_[gates_.back()].open = false; }

  /// Ends of the open edges next to `gate`, kNone without one.
  uint32_t right_of(const Edge& gate) const {
    const uint32_t edge = newest(out_[gate.to], &Edge::older_out);
    return edge == kNone ? kNone : edges_[edge].to;
  }
  uint32_t left_of(const Edge& gate) const {
    const uint32_t edge = newest(in_[gate.from], &Edge::older_in);
    return edge == kNone ? kNone : edges_[edge].from;
  }

  /// Triangles at the ends of the gate, which predict how it is closed.
  static constexpr int kUses = 9;
  size_t context(const Edge& gate) const {
    return size_t{uses_[gate.from]} * kUses + uses_[gate.to];
  }

 private:
  uint32_t newest(uint32_t edge, uint32_t Edge::*older) const {
    for (int n = 0; n < kMaxSearched && edge != kNone; ++n, edge = edges_[edge].*older) {
      if (edges_[edge].open) return edge;
    }
    return kNone;
  }

  void add_edge(uint32_t from, uint32_t to) {
    uint32_t opposite = out_[to];
    for (int n = 0; n < kMaxSearched && opposite != kNone; ++n) {
      Edge& edge = edges_[opposite];
      if (edge.open && edge.to == from) {
        edge.open = false;
        return;
      }
      opposite = edge.older_out;
    }
    const auto edge = static_cast<uint32_t>(edges_.size());
    edges_.push_back({from, to, out_[from], in_[to]});
    out_[from] = in_[to] = edge;
    gates_.push_back(edge);
  }

  std::vector<Edge> edges_;
  std::vector<uint32_t> gates_;     ///< edges, the next one last
  std::vector<uint32_t> out_, in_;  ///< [vertex]: newest edge that leaves it, enters it
  std::vector<uint8_t> uses_;       ///< [vertex]: coded triangles, below kUses
  uint32_t known_ = 0;
};

class Models {
 public:
  template <class Coder>
  Corner corner(Coder& coder, size_t context, Corner wanted) {
    for (const Corner corner : {Corner::kNew, Corner::kRight, Corner::kLeft, Corner::kKnown}) {
      BitModel& model = corners_[static_cast<size_t>(corner)][context];
      if (coder.bit(model, wanted == corner)) return corner;
    }
    return Corner::kNoTriangle;
  }
  /// A vertex below `known`; the result may exceed this when decoded.
  template <class Coder>
  uint32_t vertex(Coder& coder, uint32_t known, uint32_t wanted) {
    uint32_t vertex = 0;
    for (int digit = std::bit_width(known) - 1; digit >= 0; --digit) {
      vertex = vertex << 1 | uint32_t{coder.even_bit((wanted >> digit & 1) != 0)};
    }
    return vertex;
  }
  /// A corner of the first triangle of a component: new (returns `known`) or known. The decoder
  /// returns kNone for a vertex that is neither.
  template <class Coder>
  uint32_t first_corner(Coder& coder, uint32_t known, uint32_t wanted) {
    if (!coder.bit(first_known_, wanted < known)) return known;
    const uint32_t coded = vertex(coder, known, wanted);
    return coded < known ? coded : kNone;
  }

 private:
  std::array<std::array<BitModel, Border::kUses * Border::kUses>, 4> corners_;
  BitModel first_known_;
};

/// The remaining triangles by their directed edges.
class RemainingTriangles {
 public:
  explicit RemainingTriangles(std::span<const Triangle> triangles) : triangles_(triangles) {
    for (uint32_t t = 0; t < triangles.size(); ++t) {
      for (uint32_t side = 0; side < 3; ++side) {
        sides_.push_back({triangles[t][side], triangles[t][(side + 1) % 3], t, side});
      }
    }
    std::sort(sides_.begin(), sides_.end());
    coded_.resize(triangles.size());
  }

  bool is_coded(uint32_t triangle) const { return coded_[triangle]; }
  void set_coded(uint32_t triangle) { coded_[triangle] = true; }

  /// A remaining triangle with the edge, turned so that this edge comes first; and its number.
  std::optional<std::pair<Triangle, uint32_t>> find(uint32_t from, uint32_t to) const {
    auto side = std::lower_bound(sides_.begin(), sides_.end(), Side{from, to, 0, 0});
    for (; side != sides_.end() && (*side)[0] == from && (*side)[1] == to; ++side) {
      const auto& [a, b, triangle, turn] = *side;
      if (!coded_[triangle]) {
        return std::pair{Triangle{a, b, triangles_[triangle][(turn + 2) % 3]}, triangle};
      }
    }
    return std::nullopt;
  }

 private:
  using Side = std::array<uint32_t, 4>;  ///< from, to, triangle, position in it
  std::span<const Triangle> triangles_;
  std::vector<Side> sides_;
  std::vector<bool> coded_;
};

class ConnectivityEncoder {
 public:
  ConnectivityEncoder(std::span<const Triangle> triangles, uint32_t vertices)
      : triangles_(triangles), remaining_(triangles), border_(vertices), number_(vertices, kNone) {}

  CodedConnectivity run() {
    for (uint32_t t = 0; t < triangles_.size(); ++t) {
      if (remaining_.is_coded(t)) continue;
      start(t);
      while (const Edge* gate = border_.next_gate()) pass(*gate);
    }
    for (uint32_t v = 0; v < number_.size(); ++v) {
      if (number_[v] == kNone) coded_.order.push_back(v);
    }
    coded_.bytes = coder_.take();
    return std::move(coded_);
  }

 private:
  void start(uint32_t triangle) {
    Triangle corners;
    uint32_t known = border_.known();
    for (int c = 0; c < 3; ++c) {
      const uint32_t number = number_[triangles_[triangle][c]];
      corners[c] = models_.first_corner(coder_, known, std::min(number, known));
      if (corners[c] == known) name(triangles_[triangle][c], known++);
    }
    add(corners, triangle);
  }

  void pass(const Edge& gate) {
    const size_t context = border_.context(gate);
    const auto found = remaining_.find(coded_.order[gate.to], coded_.order[gate.from]);
    if (!found) {
      models_.corner(coder_, context, Corner::kNoTriangle);
      return border_.close_gate();
    }
    const uint32_t known = border_.known();
    const uint32_t third = std::min(number_[found->first[2]], known);
    const Corner corner = third == known                    ? Corner::kNew
                          : third == border_.right_of(gate) ? Corner::kRight
                          : third == border_.left_of(gate)  ? Corner::kLeft
                                                            : Corner::kKnown;
    models_.corner(coder_, context, corner);
    if (corner == Corner::kKnown) models_.vertex(coder_, known, third);
    if (corner == Corner::kNew) name(found->first[2], known);
    add({gate.to, gate.from, third}, found->second);
  }

  void name(uint32_t vertex, uint32_t number) {
    number_[vertex] = number;
    coded_.order.push_back(vertex);
  }
  void add(const Triangle& corners, uint32_t triangle) {
    coded_.triangles.push_back(corners);
    remaining_.set_coded(triangle);
    border_.add(corners);
  }

  std::span<const Triangle> triangles_;
  RemainingTriangles remaining_;
  Border border_;
  std::vector<uint32_t> number_;  ///< [vertex of the input]: decoded number
  RangeEncoder coder_;
  Models models_;
  CodedConnectivity coded_;
};

class ConnectivityDecoder {
 public:
  ConnectivityDecoder(std::span<const uint8_t> bytes, uint32_t vertices)
      : coder_(bytes), border_(vertices), vertices_(vertices) {}

  std::optional<std::vector<Triangle>> run(uint32_t triangles) {
    bool valid = true;
    while (valid && triangles_.size() < triangles && !coder_.overran()) {
      const Edge* gate = border_.next_gate();
      valid = gate == nullptr ? start() : pass(*gate);
    }
    // The encoder also codes that the last gates have no triangle.
    while (valid && !coder_.overran()) {
      const Edge* gate = border_.next_gate();
      if (gate == nullptr) break;
      valid = pass(*gate) && triangles_.size() == triangles;
    }
    if (!valid || !coder_.ended()) return std::nullopt;
    return std::move(triangles_);
  }

 private:
  bool start() {
    Triangle corners;
    uint32_t known = border_.known();
    for (uint32_t& corner : corners) {
      corner = models_.first_corner(coder_, known, 0);
      if (corner >= vertices_) return false;
      known += uint32_t{corner == known};
    }
    add(corners);
    return true;
  }

  bool pass(const Edge& gate) {
    const uint32_t known = border_.known();
    uint32_t third = kNone;
    switch (models_.corner(coder_, border_.context(gate), Corner::kNew)) {
      case Corner::kNew:
        third = known;
        break;
      case Corner::kRight:
        third = border_.right_of(gate);
        break;
      case Corner::kLeft:
        third = border_.left_of(gate);
        break;
      case Corner::kKnown:
        third = models_.vertex(coder_, known, 0);
        if (third >= known) return false;
        break;
      case Corner::kNoTriangle:
        border_.close_gate();
        return true;
    }
    if (third >= vertices_) return false;
    add({gate.to, gate.from, third});
    return true;
  }

  void add(const Triangle& corners) {
    triangles_.push_back(corners);
    border_.add(corners);
  }

  RangeDecoder coder_;
  Border border_;
  uint32_t vertices_;
  Models models_;
  std::vector<Triangle> triangles_;
};

}  // namespace

CodedConnectivity encode_connectivity(std::span<const Triangle> triangles, uint32_t vertices) {
  for (const Triangle& t : triangles) {
    V3D_CODEC_CHECK(*std::max_element(t.begin(), t.end()) < vertices);
  }
  return ConnectivityEncoder(triangles, vertices).run();
}

std::optional<std::vector<Triangle>> decode_connectivity(std::span<const uint8_t> bytes,
                                                         uint32_t triangles, uint32_t vertices) {
  return ConnectivityDecoder(bytes, vertices).run(triangles);
}

}  // namespace v3d::codec
