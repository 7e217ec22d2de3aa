// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>

namespace veneer::soak {

/// Counts what this thread allocates while it is armed: every call of malloc and its like, from
/// whatever library, but those that come out of a GL driver.
///
/// For a program of its own: it replaces malloc, calloc and realloc.
class AllocationGuard {
 public:
  /// To be called once before anything is armed, in any thread: what it needs is found and loaded.
  static void prepare();
  static void arm();
  static void disarm();
  /// Since prepare(), in all threads.
  [[nodiscard]] static std::uint64_t ours();
  /// Out of the driver, while armed.
  [[nodiscard]] static std::uint64_t of_driver();
  /// Where the first of ours came from, a line a call.
  [[nodiscard]] static std::string first();
};

}  // namespace veneer::soak
