#include "base/checksum.h"

#include <xxhash.h>

#include <memory>
#include <new>

namespace v3d {

uint64_t checksum(std::initializer_list<std::span<const uint8_t>> parts) {
  const std::unique_ptr<XXH3_state_t, decltype(&XXH3_freeState)> state(XXH3_createState(),
                                                                       &XXH3_freeState);
  if (!state) throw std::bad_alloc();
  XXH3_64bits_reset(state.get());
  for (const std::span<const uint8_t> part : parts) {
    XXH3_64bits_update(state.get(), part.data(), part.size());
  }
  return XXH3_64bits_digest(state.get());
}

}  // namespace v3d
