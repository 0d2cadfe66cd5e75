#include "recon/zstd_section.h"

#include <zstd.h>

#include <algorithm>
#include <array>
#include <memory>
#include <new>
#include <stdexcept>

namespace v3d {
namespace {

constexpr int kLevel = 1;  // live: level 3 takes twice as long for frames 2.5 % smaller
constexpr std::array<uint8_t, 4> kMagic{0x28, 0xB5, 0x2F, 0xFD};
constexpr uint8_t kChecksumFlag = 0x04;  // of the frame header descriptor, RFC 8878 3.1.1.1.1

struct FreeContext {
  void operator()(ZSTD_CCtx* context) const { ZSTD_freeCCtx(context); }
};

/// The thread's own, kept from frame to frame: its tables are a megabyte of fresh pages.
ZSTD_CCtx* context_of_thread() {
  thread_local const std::unique_ptr<ZSTD_CCtx, FreeContext> kContext(ZSTD_createCCtx());
  if (!kContext) {
    throw std::bad_alloc();
  }
  return kContext.get();
}

}  // namespace

std::vector<uint8_t> compress_section(std::span<const uint8_t> content) {
  ZSTD_CCtx* context = context_of_thread();
  ZSTD_CCtx_setParameter(context, ZSTD_c_compressionLevel, kLevel);
  ZSTD_CCtx_setParameter(context, ZSTD_c_checksumFlag, 1);
  std::vector<uint8_t> section(ZSTD_compressBound(content.size()));
  const size_t size =
      ZSTD_compress2(context, section.data(), section.size(), content.data(), content.size());
  if (ZSTD_isError(size)) {
    throw std::runtime_error(ZSTD_getErrorName(size));
  }
  section.resize(size);
  return section;
}

std::optional<std::vector<uint8_t>> decompress_section(std::span<const uint8_t> section,
                                                       size_t least, size_t most) {
  const bool one_frame =
      section.size() > kMagic.size() && std::equal(kMagic.begin(), kMagic.end(), section.begin()) &&
      ZSTD_findFrameCompressedSize(section.data(), section.size()) == section.size();
  if (!one_frame || !(section[kMagic.size()] & kChecksumFlag)) {
    return std::nullopt;
  }
  // Unknown and error are huge numbers, beyond any `most`.
  const unsigned long long stated = ZSTD_getFrameContentSize(section.data(), section.size());
  if (stated < least || stated > most) {
    return std::nullopt;
  }
  std::vector<uint8_t> content(stated);
  const size_t size =
      ZSTD_decompress(content.data(), content.size(), section.data(), section.size());
  if (size != content.size()) {  // an error is a huge number
    return std::nullopt;
  }
  return content;
}

}  // namespace v3d
