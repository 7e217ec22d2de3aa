// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>

namespace veneer {

/// Threads that parallel loops use: the environment variable VENEER_THREADS (1 to 1024), else what
/// the machine has.
[[nodiscard]] int thread_count();

/// Calls `body(begin, end)` on pieces of [0, count) of at most `grain` indices, on several threads,
/// and returns when all are done. Which thread takes which piece is not fixed, so `body` must give
/// the same result in any order. Calls may not nest. `body` must not throw.
void parallel_for(std::int64_t count,
                  std::int64_t grain,
                  const std::function<void(std::int64_t begin, std::int64_t end)>& body);

}  // namespace veneer
