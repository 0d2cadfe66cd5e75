#include "recon/compact_frame.h"

#include <tbb/parallel_invoke.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <type_traits>
#include <utility>

#include "base/error.h"
#include "codec/byte_stream.h"
#include "recon/zstd_section.h"

namespace v3d {
namespace {

constexpr std::array<uint8_t, 8> kMagic{'V', '3', 'D', 'F', 0x0D, 0x0A, 0x1A, 0x0A};
constexpr uint16_t kVersion = 1;
constexpr uint16_t kHasColours = 1;
constexpr size_t kHeaderBytes = 88;
constexpr size_t kMostCodeBytes = 4;  // of one index of a triangle

/// Half voxels per axis.
using LatticePoint = std::array<uint16_t, 3>;

uint16_t fold(uint16_t difference) {
  return static_cast<uint16_t>((difference << 1) ^ (difference & 0x8000 ? 0xFFFF : 0));
}
uint16_t unfold(uint16_t z) { return static_cast<uint16_t>((z >> 1) ^ (z & 1 ? 0xFFFF : 0)); }

// --- positions ---------------------------------------------------------------------------------

float position_at(const VertexLattice& lattice, int axis, uint16_t h) {
  return static_cast<float>(lattice.origin[axis] + h * lattice.step);
}

uint16_t lattice_number(const VertexLattice& lattice, float position, int axis) {
  const double h = (double{position} - lattice.origin[axis]) / lattice.step + 0.5;
  if (!(h >= 0 && h < 65536)) {
    throw InputError("compact frame: a vertex at " + std::to_string(position) +
                     " m lies outside the lattice; it holds 65536 half voxels along each axis");
  }
  return static_cast<uint16_t>(h);
}

std::vector<uint8_t> position_content(const std::vector<Eigen::Vector3f>& positions,
                                      const VertexLattice& lattice) {
  const size_t count = positions.size();
  std::vector<uint8_t> content(6 * count);
  for (int axis = 0; axis < 3; ++axis) {
    uint8_t* low = content.data() + 2 * axis * count;
    uint16_t before = 0;
    for (size_t v = 0; v < count; ++v) {
      const uint16_t h = lattice_number(lattice, positions[v][axis], axis);
      const uint16_t z = fold(static_cast<uint16_t>(h - before));
      low[v] = static_cast<uint8_t>(z);
      low[count + v] = static_cast<uint8_t>(z >> 8);
      before = h;
    }
  }
  return content;
}

std::vector<Eigen::Vector3f> positions_of(std::span<const uint8_t> content,
                                          const VertexLattice& lattice) {
  const size_t count = content.size() / 6;
  std::vector<Eigen::Vector3f> positions(count);
  for (int axis = 0; axis < 3; ++axis) {
    const uint8_t* low = content.data() + 2 * axis * count;
    uint16_t h = 0;
    for (size_t v = 0; v < count; ++v) {
      h = static_cast<uint16_t>(h + unfold(static_cast<uint16_t>(low[v] | low[count + v] << 8)));
      positions[v][axis] = position_at(lattice, axis, h);
    }
  }
  return positions;
}

// --- colours -----------------------------------------------------------------------------------

std::vector<uint8_t> colour_content(const std::vector<Rgb8>& colours) {
  const size_t count = colours.size();
  std::vector<uint8_t> content(3 * count);
  Rgb8 before;
  for (size_t v = 0; v < count; ++v) {
    const Rgb8 c = colours[v];
    const int green = c.g - before.g;
    content[v] = static_cast<uint8_t>(green);
    content[count + v] = static_cast<uint8_t>(c.r - before.r - green);
    content[2 * count + v] = static_cast<uint8_t>(c.b - before.b - green);
    before = c;
  }
  return content;
}

std::vector<Rgb8> colours_of(std::span<const uint8_t> content) {
  const size_t count = content.size() / 3;
  std::vector<Rgb8> colours(count);
  Rgb8 c;
  for (size_t v = 0; v < count; ++v) {
    const int green = content[v];
    c.g = static_cast<uint8_t>(c.g + green);
    c.r = static_cast<uint8_t>(c.r + green + content[count + v]);
    c.b = static_cast<uint8_t>(c.b + green + content[2 * count + v]);
    colours[v] = c;
  }
  return colours;
}

// --- triangles ---------------------------------------------------------------------------------

std::vector<uint8_t> compressed_triangles(const Mesh& mesh) {
  const auto content =
      std::make_unique_for_overwrite<uint8_t[]>(3 * kMostCodeBytes * mesh.triangles.size());
  uint8_t* end = content.get();
  uint32_t next = 0;
  for (const auto& triangle : mesh.triangles) {
    for (const uint32_t index : triangle) {
      uint32_t code = next - index;
      next += code == 0;
      for (; code >= 0x80; code >>= 7) {
        *end++ = static_cast<uint8_t>(code | 0x80);
      }
      *end++ = static_cast<uint8_t>(code);
    }
  }
  return compress_section({content.get(), end});
}

/// One LEB128 number of at most kMostCodeBytes; empty when there is none or it is longer than it
/// need be.
std::optional<uint32_t> take_code(std::span<const uint8_t>& content) {
  uint32_t code = 0;
  for (size_t i = 0; i < std::min(content.size(), kMostCodeBytes); ++i) {
    code |= uint32_t{content[i] & 0x7FU} << (7 * i);
    if (content[i] < 0x80) {
      if (i > 0 && content[i] == 0) {
        return std::nullopt;
      }
      content = content.subspan(i + 1);
      return code;
    }
  }
  return std::nullopt;
}

/// False when a code is wrong or the codes do not fill the content.
bool read_triangles(std::span<const uint8_t> content, uint32_t vertices,
                    std::vector<std::array<uint32_t, 3>>& triangles) {
  uint32_t next = 0;
  for (auto& triangle : triangles) {
    for (uint32_t& index : triangle) {
      const auto code = take_code(content);
      if (!code || *code > next || (*code == 0 && next == vertices)) {
        return false;
      }
      index = next - *code;
      next += *code == 0;
    }
  }
  return content.empty();
}

// --- names -------------------------------------------------------------------------------------

std::vector<uint8_t> name_content(const std::vector<std::string>& names) {
  std::vector<uint8_t> content;
  for (const std::string& name : names) {
    content.push_back(static_cast<uint8_t>(name.size()));
    content.insert(content.end(), name.begin(), name.end());
  }
  return content;
}

std::optional<std::vector<std::string>> names_of(std::span<const uint8_t> content, int count) {
  std::vector<std::string> names;
  for (int i = 0; i < count; ++i) {
    const size_t length = content.empty() ? 0 : content[0];
    if (length == 0 || length > kMaxCompactNameBytes || length >= content.size()) {
      return std::nullopt;
    }
    names.emplace_back(reinterpret_cast<const char*>(content.data()) + 1, length);
    if (i > 0 && !(names[i - 1] < names[i])) {
      return std::nullopt;
    }
    content = content.subspan(1 + length);
  }
  return content.empty() ? std::optional(names) : std::nullopt;
}

// --- the whole ---------------------------------------------------------------------------------

struct Header {
  uint16_t flags = 0;
  uint16_t cameras = 0;
  uint16_t missing = 0;
  int64_t pulse = 0;
  int64_t exposure_ns = 0;
  VertexLattice lattice;
  uint32_t vertices = 0;
  uint32_t triangles = 0;
  std::array<uint32_t, 4> section_bytes{};  ///< names, positions, colours, triangles
};

void write_header(ByteWriter& out, const Header& h) {
  out.bytes(kMagic);
  out.number(kVersion);
  out.number(h.flags);
  out.number(h.cameras);
  out.number(h.missing);
  out.number(h.pulse);
  out.number(h.exposure_ns);
  for (int axis = 0; axis < 3; ++axis) {
    out.number(h.lattice.origin[axis]);
  }
  out.number(h.lattice.step);
  out.number(h.vertices);
  out.number(h.triangles);
  for (const uint32_t bytes : h.section_bytes) {
    out.number(bytes);
  }
}

bool is_sound(const Header& h, size_t bytes_behind) {
  uint64_t sections = 0;
  for (const uint32_t bytes : h.section_bytes) {
    sections += bytes;
  }
  const bool coloured = h.flags == kHasColours;
  return (coloured || h.flags == 0) && (coloured || h.section_bytes[2] == 0) &&
         h.cameras <= kMaxCompactCameras && h.missing <= kMaxCompactCameras && h.pulse >= 0 &&
         h.lattice.origin.allFinite() && std::isfinite(h.lattice.step) && h.lattice.step > 0 &&
         h.vertices <= kMaxCompactVertices && h.triangles <= kMaxCompactTriangles &&
         sections == bytes_behind;
}

std::optional<Header> read_header(std::span<const uint8_t> bytes) {
  if (bytes.size() < kHeaderBytes || !std::equal(kMagic.begin(), kMagic.end(), bytes.begin())) {
    return std::nullopt;
  }
  ByteReader in(bytes.subspan(kMagic.size()));
  Header h;
  if (in.number<uint16_t>() != kVersion) {
    return std::nullopt;
  }
  h.flags = in.number<uint16_t>();
  h.cameras = in.number<uint16_t>();
  h.missing = in.number<uint16_t>();
  h.pulse = in.number<int64_t>();
  h.exposure_ns = in.number<int64_t>();
  for (int axis = 0; axis < 3; ++axis) {
    h.lattice.origin[axis] = in.number<double>();
  }
  h.lattice.step = in.number<double>();
  h.vertices = in.number<uint32_t>();
  h.triangles = in.number<uint32_t>();
  for (uint32_t& section : h.section_bytes) {
    section = in.number<uint32_t>();
  }
  return is_sound(h, bytes.size() - kHeaderBytes) ? std::optional(h) : std::nullopt;
}

void require_limits(const CompactFrame& frame) {
  const auto require = [](bool holds, const std::string& what) {
    if (!holds) {
      throw InputError("compact frame: " + what);
    }
  };
  require(frame.mesh.vertices.size() <= kMaxCompactVertices,
          std::to_string(frame.mesh.vertices.size()) + " vertices; at most " +
              std::to_string(kMaxCompactVertices) + " fit, use a larger voxel");
  require(frame.mesh.triangles.size() <= kMaxCompactTriangles,
          std::to_string(frame.mesh.triangles.size()) + " triangles; at most " +
              std::to_string(kMaxCompactTriangles) + " fit, use a larger voxel");
  require(frame.cameras.size() <= kMaxCompactCameras && frame.missing <= kMaxCompactCameras,
          "more than " + std::to_string(kMaxCompactCameras) + " cameras");
  require(frame.pulse >= 0, "pulse " + std::to_string(frame.pulse) + " must not be negative");
  require(frame.lattice.origin.allFinite() && std::isfinite(frame.lattice.step) &&
              frame.lattice.step > 0,
          "the lattice needs a finite origin and a step greater than 0");
  for (const std::string& name : frame.cameras) {
    require(!name.empty() && name.size() <= kMaxCompactNameBytes,
            "camera name '" + name + "' must have 1 to 64 bytes");
  }
}

/// Whether in_coding_order(mesh) would change nothing.
bool is_in_coding_order(const Mesh& mesh) {
  uint32_t next = 0;
  for (const auto& triangle : mesh.triangles) {
    for (const uint32_t index : triangle) {
      if (index > next) {
        return false;
      }
      next += index == next;
    }
  }
  return true;
}

/// The content of a section, if it is `expected` bytes long.
std::optional<std::vector<uint8_t>> content_of(std::span<const uint8_t> section, size_t expected) {
  return decompress_section(section, expected, expected);
}

}  // namespace

Eigen::Vector3f rounded_to(const VertexLattice& lattice, const Eigen::Vector3f& position) {
  Eigen::Vector3f rounded;
  for (int axis = 0; axis < 3; ++axis) {
    const double h = (double{position[axis]} - lattice.origin[axis]) / lattice.step + 0.5;
    rounded[axis] =
        position_at(lattice, axis, static_cast<uint16_t>(std::clamp(h, 0.0, double{0xFFFF})));
  }
  return rounded;
}

Mesh in_coding_order(Mesh mesh) {
  if (is_in_coding_order(mesh)) {
    return mesh;
  }
  constexpr uint32_t kUnnumbered = 0xFFFFFFFF;
  std::vector<uint32_t> number(mesh.vertices.size(), kUnnumbered);
  std::vector<uint32_t> order;
  order.reserve(mesh.vertices.size());
  const auto visit = [&](uint32_t v) {
    if (number[v] == kUnnumbered) {
      number[v] = static_cast<uint32_t>(order.size());
      order.push_back(v);
    }
    return number[v];
  };
  for (auto& triangle : mesh.triangles) {
    std::transform(triangle.begin(), triangle.end(), triangle.begin(), visit);
  }
  for (uint32_t v = 0; v < number.size(); ++v) {
    visit(v);
  }
  const auto reorder = [&](auto& items) {
    std::remove_reference_t<decltype(items)> moved;
    moved.reserve(items.size());
    for (size_t i = 0; i < items.size(); ++i) {
      moved.push_back(items[order[i]]);
    }
    items = std::move(moved);
  };
  reorder(mesh.vertices);
  reorder(mesh.colours);
  return mesh;
}

std::vector<uint8_t> encode_compact(const CompactFrame& frame) {
  require_limits(frame);
  Mesh renumbered;
  const bool as_it_is = is_in_coding_order(frame.mesh);
  if (!as_it_is) {
    renumbered = in_coding_order(frame.mesh);
  }
  const Mesh& mesh = as_it_is ? frame.mesh : renumbered;
  std::vector<std::string> cameras = frame.cameras;
  std::sort(cameras.begin(), cameras.end());

  const bool coloured = !mesh.colours.empty();
  std::array<std::vector<uint8_t>, 4> sections{name_content(cameras)};
  auto& [names, positions, colours, triangles] = sections;
  tbb::parallel_invoke(
      [&, &positions = positions] {
        positions = compress_section(position_content(mesh.vertices, frame.lattice));
      },
      [&, &triangles = triangles] { triangles = compressed_triangles(mesh); },
      [&, &colours = colours] {
        if (coloured) {
          colours = compress_section(colour_content(mesh.colours));
        }
      });
  Header header{.flags = coloured ? kHasColours : uint16_t{0},
                .cameras = static_cast<uint16_t>(cameras.size()),
                .missing = static_cast<uint16_t>(frame.missing),
                .pulse = frame.pulse,
                .exposure_ns = to_ns(frame.exposure),
                .lattice = frame.lattice,
                .vertices = static_cast<uint32_t>(mesh.vertices.size()),
                .triangles = static_cast<uint32_t>(mesh.triangles.size()),
                .section_bytes = {}};
  for (size_t i = 0; i < sections.size(); ++i) {
    header.section_bytes[i] = static_cast<uint32_t>(sections[i].size());
  }
  ByteWriter out;
  write_header(out, header);
  for (const auto& section : sections) {
    out.bytes(section);
  }
  return out.take();
}

std::optional<CompactFrame> decode_compact(std::span<const uint8_t> bytes) {
  const auto header = read_header(bytes);
  if (!header) {
    return std::nullopt;
  }
  std::array<std::span<const uint8_t>, 4> section;
  size_t begin = kHeaderBytes;
  for (size_t i = 0; i < section.size(); ++i) {
    section[i] = bytes.subspan(begin, header->section_bytes[i]);
    begin += section[i].size();
  }
  const auto names = names_of(section[0], header->cameras);
  if (!names) {
    return std::nullopt;
  }
  CompactFrame frame{.pulse = header->pulse,
                     .exposure = from_ns<Realtime>(header->exposure_ns),
                     .cameras = *names,
                     .missing = header->missing,
                     .lattice = header->lattice,
                     .mesh = {}};
  const auto positions = content_of(section[1], size_t{6} * header->vertices);
  if (!positions) {
    return std::nullopt;
  }
  frame.mesh.vertices = positions_of(*positions, frame.lattice);
  if (header->flags & kHasColours) {
    const auto colours = content_of(section[2], size_t{3} * header->vertices);
    if (!colours) {
      return std::nullopt;
    }
    frame.mesh.colours = colours_of(*colours);
  }
  const size_t indices = size_t{3} * header->triangles;
  const auto codes = decompress_section(section[3], indices, kMostCodeBytes * indices);
  if (!codes) {
    return std::nullopt;
  }
  frame.mesh.triangles.resize(header->triangles);
  if (!read_triangles(*codes, header->vertices, frame.mesh.triangles)) {
    return std::nullopt;
  }
  return frame;
}

}  // namespace v3d
