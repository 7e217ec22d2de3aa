// SPDX-License-Identifier: Apache-2.0
#include "base/parallel.h"

#include <algorithm>
#include <atomic>
#include <charconv>
#include <cstdlib>
#include <cstring>
#include <thread>
#include <vector>

namespace veneer {

int thread_count() {
  static const int kCount = [] {
    constexpr int kMost = 1024;
    int count = 0;
    if (const char* wish = std::getenv("VENEER_THREADS")) {
      std::from_chars(wish, wish + std::strlen(wish), count);
    }
    if (count < 1) count = static_cast<int>(std::thread::hardware_concurrency());
    return std::clamp(count, 1, kMost);
  }();
  return kCount;
}

void parallel_for(std::int64_t count,
                  std::int64_t grain,
                  const std::function<void(std::int64_t begin, std::int64_t end)>& body) {
  if (count <= 0) return;
  grain = std::max<std::int64_t>(grain, 1);
  std::atomic<std::int64_t> next{0};
  const auto work = [&] {
    for (;;) {
      const std::int64_t begin = next.fetch_add(grain);
      if (begin >= count) return;
      body(begin, std::min(begin + grain, count));
    }
  };
  const std::int64_t pieces = (count + grain - 1) / grain;
  const auto helpers = std::min<std::int64_t>(thread_count(), pieces) - 1;
  std::vector<std::jthread> threads;
  for (std::int64_t i = 0; i < helpers; ++i) threads.emplace_back(work);
  work();
}

}  // namespace veneer
