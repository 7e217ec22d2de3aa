// SPDX-License-Identifier: Apache-2.0
#include "tests/soak/allocation_guard.h"

#include <dlfcn.h>
#include <execinfo.h>
#include <link.h>
#include <malloc.h>

#include <array>
#include <atomic>
#include <bit>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <string_view>

extern "C" {
// glibc's own, under the names by which it can be called from a replacement.
void* __libc_malloc(std::size_t bytes);
void* __libc_calloc(std::size_t count, std::size_t bytes);
void* __libc_realloc(void* memory, std::size_t bytes);
void* __libc_memalign(std::size_t alignment, std::size_t bytes);
}

namespace veneer::soak {
namespace {

struct Range {
  std::uintptr_t begin = 0;
  std::uintptr_t end = 0;
};
constexpr std::size_t kMostRanges = 64;
constexpr int kMostDepth = 64;

std::array<Range, kMostRanges> driver_ranges;
std::size_t driver_range_count = 0;
std::atomic<std::uint64_t> our_count{0};
std::atomic<std::uint64_t> driver_count{0};
std::array<void*, kMostDepth> first_stack;
std::atomic<int> first_depth{0};

thread_local bool armed = false;

bool is_driver(std::string_view path) {
  for (const char* part :
       {"_dri.so", "libgallium", "libLLVM", "libEGL", "libGL", "libglapi", "libgbm", "libepoxy"}) {
    if (path.find(part) != std::string_view::npos) return true;
  }
  return false;
}

int remember_range(dl_phdr_info* info, std::size_t /*size*/, void* /*data*/) {
  if (!is_driver(info->dlpi_name)) return 0;
  for (int i = 0; i < info->dlpi_phnum && driver_range_count < kMostRanges; ++i) {
    const ElfW(Phdr)& header = info->dlpi_phdr[i];
    if (header.p_type != PT_LOAD || (header.p_flags & PF_X) == 0) continue;
    const std::uintptr_t begin = info->dlpi_addr + header.p_vaddr;
    driver_ranges[driver_range_count++] = {begin, begin + header.p_memsz};
  }
  return 0;
}

// Called where something is allocated, so it may not allocate.
void count() {
  armed = false;
  std::array<void*, kMostDepth> stack{};
  const int depth = ::backtrace(stack.data(), kMostDepth);
  bool driver = false;
  for (int i = 0; i < depth && !driver; ++i) {
    const auto address = reinterpret_cast<std::uintptr_t>(stack[static_cast<std::size_t>(i)]);
    for (std::size_t r = 0; r < driver_range_count; ++r)
      driver = driver || (address >= driver_ranges[r].begin && address < driver_ranges[r].end);
  }
  if (driver) {
    ++driver_count;
  } else if (++our_count == 1) {
    first_stack = stack;
    first_depth = depth;
  }
  armed = true;
}

}  // namespace

void AllocationGuard::prepare() {
  std::array<void*, 4> stack{};
  ::backtrace(stack.data(), 4);  // loads what unwinds
  driver_range_count = 0;
  ::dl_iterate_phdr(remember_range, nullptr);
}

void AllocationGuard::arm() { armed = true; }
void AllocationGuard::disarm() { armed = false; }
std::uint64_t AllocationGuard::ours() { return our_count; }
std::uint64_t AllocationGuard::of_driver() { return driver_count; }

std::string AllocationGuard::first() {
  std::string text;
  char** const names = ::backtrace_symbols(first_stack.data(), first_depth);
  for (int i = 0; i < first_depth; ++i) text += std::string(names[i]) + "\n";
  std::free(names);
  return text;
}

}  // namespace veneer::soak

extern "C" {
void* malloc(std::size_t bytes) {
  if (veneer::soak::armed) veneer::soak::count();
  return __libc_malloc(bytes);
}
void* calloc(std::size_t count, std::size_t bytes) {
  if (veneer::soak::armed) veneer::soak::count();
  return __libc_calloc(count, bytes);
}
void* realloc(void* memory, std::size_t bytes) {
  if (veneer::soak::armed) veneer::soak::count();
  return __libc_realloc(memory, bytes);
}
// What is aligned more than usual (a matrix of Eigen in a vector, a cache line) comes from these.
void* memalign(std::size_t alignment, std::size_t bytes) {
  if (veneer::soak::armed) veneer::soak::count();
  return __libc_memalign(alignment, bytes);
}
void* aligned_alloc(std::size_t alignment, std::size_t bytes) {
  if (veneer::soak::armed) veneer::soak::count();
  return __libc_memalign(alignment, bytes);
}
int posix_memalign(void** memory, std::size_t alignment, std::size_t bytes) {
  if (veneer::soak::armed) veneer::soak::count();
  if (alignment % sizeof(void*) != 0 || !std::has_single_bit(alignment)) return EINVAL;
  void* const found = __libc_memalign(alignment, bytes);
  if (found == nullptr) return ENOMEM;
  *memory = found;
  return 0;
}
}
