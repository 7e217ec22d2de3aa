// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

namespace veneer::soak {

/// From now on, counts the names of GL objects that this program makes and deletes, between it and
/// the driver.
void count_gl_objects();
/// Names that were made and not deleted.
[[nodiscard]] std::int64_t live_gl_objects();

/// What this process holds.
struct Holdings {
  std::int64_t heap_bytes = 0;  ///< in use, of all arenas and maps of malloc
  std::int64_t resident_bytes = 0;
  std::int64_t descriptors = 0;
  std::int64_t threads = 0;
  std::int64_t gl_objects = 0;
  [[nodiscard]] static Holdings now();
};
[[nodiscard]] std::string text_of(const Holdings& holdings);

}  // namespace veneer::soak
