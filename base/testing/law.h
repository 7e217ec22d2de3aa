// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdio>
#include <cstdlib>

#include "base/result.h"

namespace veneer {

/// For fuzzers of bytes: ends the program where a law does not hold, so that its input is kept.
inline void law(bool holds, const char* what) {
  if (holds) return;
  std::fprintf(stderr, "broken: %s\n", what);
  std::abort();
}

template <class T>
void has_text(const Result<T>& result) {
  law(result.has_value() || !result.error().what.empty(), "a refusal without a text");
}

}  // namespace veneer
