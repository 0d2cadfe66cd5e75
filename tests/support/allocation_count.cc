#include "support/allocation_count.h"

#include <malloc.h>

#include <atomic>
#include <cstdlib>
#include <new>

namespace {
std::atomic<int64_t> count = 0;
std::atomic<int64_t> failing = 0;         ///< the number of the allocation that fails; 0: none
std::atomic<int64_t> live = 0, peak = 0;  ///< bytes

void* allocate(size_t size) noexcept {
  void* const bytes = std::malloc(size > 0 ? size : 1);
  if (bytes == nullptr) return nullptr;
  const int64_t now = live += static_cast<int64_t>(malloc_usable_size(bytes));
  int64_t highest = peak;
  while (highest < now && !peak.compare_exchange_weak(highest, now)) {
  }
  return bytes;
}

void release(void* bytes) noexcept {
  live -= static_cast<int64_t>(malloc_usable_size(bytes));  // 0 for null
  std::free(bytes);
}
}  // namespace

void* operator new(size_t size) {
  void* const bytes = ++count == failing ? nullptr : allocate(size);
  if (bytes == nullptr) throw std::bad_alloc();
  return bytes;
}
void* operator new(size_t size, const std::nothrow_t&) noexcept {
  ++count;
  return allocate(size);
}
void operator delete(void* bytes, const std::nothrow_t&) noexcept { release(bytes); }
void operator delete(void* bytes) noexcept { release(bytes); }
void operator delete(void* bytes, size_t) noexcept { release(bytes); }

namespace v3d::test {
int64_t allocations() { return count; }
int64_t live_bytes() { return live; }
int64_t peak_bytes() { return peak; }
void forget_peak() { peak = live.load(); }
void fail_allocation(int64_t n) { failing = count + n; }
}  // namespace v3d::test
