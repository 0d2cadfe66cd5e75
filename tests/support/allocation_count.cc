#include "support/allocation_count.h"

#include <atomic>
#include <cstdlib>
#include <new>

namespace {
std::atomic<int64_t> count = 0;
std::atomic<int64_t> failing = 0;  ///< the number of the allocation that fails; 0: none
}  // namespace

void* operator new(size_t size) {
  void* const bytes = ++count == failing ? nullptr : std::malloc(size > 0 ? size : 1);
  if (bytes == nullptr) throw std::bad_alloc();
  return bytes;
}
void* operator new(size_t size, const std::nothrow_t&) noexcept {
  ++count;
  return std::malloc(size > 0 ? size : 1);
}
void operator delete(void* bytes, const std::nothrow_t&) noexcept { std::free(bytes); }
void operator delete(void* bytes) noexcept { std::free(bytes); }
void operator delete(void* bytes, size_t) noexcept { std::free(bytes); }

namespace v3d::test {
int64_t allocations() { return count; }
void fail_allocation(int64_t n) { failing = count + n; }
}  // namespace v3d::test
