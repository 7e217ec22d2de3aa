// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>

// What this process holds, for tests of what it must give back.
namespace veneer::tracking {

inline std::size_t count_entries(const char* folder) {
  std::size_t count = 0;
  for ([[maybe_unused]] const auto& entry : std::filesystem::directory_iterator(folder)) ++count;
  return count;
}
inline std::size_t count_descriptors() { return count_entries("/proc/self/fd"); }
inline std::size_t count_threads() { return count_entries("/proc/self/task"); }

}  // namespace veneer::tracking
