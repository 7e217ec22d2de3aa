// SPDX-License-Identifier: Apache-2.0
#include "base/testing/allocation_bound.h"

#include <sanitizer/allocator_interface.h>

#include <atomic>
#include <cstdint>
#include <cstdlib>
#include <string>
#include <thread>
#include <vector>

#include "base/result.h"

namespace veneer {
namespace {

std::atomic<std::int64_t> in_use{0};  // relative: what is freed may be older than the count
std::atomic<std::int64_t> most{0};

// Called where something is allocated, so they may not allocate.
void on_malloc(const volatile void* /*memory*/, std::size_t size) {
  const std::int64_t now = in_use += static_cast<std::int64_t>(size);
  std::int64_t highest = most;
  while (now > highest && !most.compare_exchange_weak(highest, now)) {
  }
}
void on_free(const volatile void* memory) {
  if (memory == nullptr) return;
  in_use -=
      static_cast<std::int64_t>(__sanitizer_get_allocated_size(const_cast<const void*>(memory)));
}

/// So that no compiler leaves an allocation out.
void* kept(void* memory) {
  asm volatile("" : "+r"(memory) : : "memory");
  return memory;
}

}  // namespace

std::size_t most_in_use(const std::function<void()>& act) {
  static const bool kCounting =
      __sanitizer_install_malloc_and_free_hooks(&on_malloc, &on_free) != 0;
  VENEER_CHECK(kCounting);
  const std::int64_t before = in_use;
  most = before;
  act();
  return static_cast<std::size_t>(most - before);
}

std::size_t most_in_use(const std::function<void()>& act, std::size_t bound) {
  const std::size_t used = most_in_use(act);
  return used <= bound ? used : most_in_use(act);
}

void check_that_use_is_counted() {
  constexpr std::size_t kBlock = std::size_t{1} << 20U;
  constexpr std::size_t kRoom = kBlock / 2;  // for a thread, and what else there is
  const auto is_counted = [](std::size_t blocks, const std::function<void()>& act) {
    const std::size_t used = most_in_use(act);
    return used >= blocks * kBlock && used < blocks * kBlock + kRoom;
  };
  const auto one = [] { std::free(kept(std::malloc(kBlock))); };
  VENEER_CHECK(is_counted(1, one));
  VENEER_CHECK(is_counted(1, [&] {
    for (int i = 0; i < 8; ++i) one();
  }));
  VENEER_CHECK(is_counted(8, [] {
    std::vector<std::string> blocks(8);
    for (std::string& block : blocks) block.reserve(kBlock);
    kept(blocks.data());
  }));
  VENEER_CHECK(is_counted(1, [&] { std::thread(one).join(); }));
  VENEER_CHECK(is_counted(1, [] {
    std::free(kept(std::realloc(kept(std::malloc(1)), kBlock)));
    std::free(kept(std::calloc(kBlock / 16, 16)));
    std::free(kept(std::aligned_alloc(64, kBlock)));
    operator delete(kept(operator new(kBlock)));
  }));
  // A law that is held against the count: a table that is made once is forgiven, a habit is not.
  void* table = nullptr;
  VENEER_CHECK(most_in_use(
                   [&] {
                     if (table == nullptr) table = kept(std::malloc(kBlock));
                   },
                   kRoom) <= kRoom);
  std::free(table);
  VENEER_CHECK(most_in_use(one, kRoom) > kRoom);
}

}  // namespace veneer
