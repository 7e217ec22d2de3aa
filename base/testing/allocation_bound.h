// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <functional>

namespace veneer {

/// For fuzzers: how much of the heap may be in use at a time while an input of so many bytes is
/// taken, beyond what was in use before.
struct AllocationBound {
  std::size_t bytes = 0;           ///< whatever the input: buffers, messages, the library's own
  std::size_t bytes_per_byte = 0;  ///< what an input may ask for by being longer

  [[nodiscard]] std::size_t of(std::size_t size) const { return bytes + bytes_per_byte * size; }
};

/// The most of the heap that was in use at a time while `act` ran, beyond what was before, in
/// bytes. Counts what was asked for, touched or not, on all threads. Only under a sanitizer's
/// allocator, whose hooks it uses.
[[nodiscard]] std::size_t most_in_use(const std::function<void()>& act);

/// As most_in_use(). If that is over the bound, `act` is run once more, since what is made once and
/// kept (a table, a library's registry) is no input's doing.
[[nodiscard]] std::size_t most_in_use(const std::function<void()>& act, std::size_t bound);

/// Ends the program if the count misses what is allocated: what is held at once, whoever allocates
/// it and however, or counts what was given back.
void check_that_use_is_counted();

}  // namespace veneer
