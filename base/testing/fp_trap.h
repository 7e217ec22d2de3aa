// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cfenv>

namespace veneer {

/// For tests: while it lives, an invalid operation (0/0, inf - inf, the root of a negative) and a
/// division by zero of this thread end the program with SIGFPE at the instruction that made them.
/// Threads that are started meanwhile inherit it. Not around GL: drivers and their compilers
/// compute with flags of their own (FpPause).
class FpTrap {
 public:
  FpTrap() : before_(::fegetexcept()) {
    // A flag that is already up would trap at once on x87.
    std::feclearexcept(kTrapped);
    ::feenableexcept(kTrapped);
  }
  FpTrap(const FpTrap&) = delete;
  FpTrap& operator=(const FpTrap&) = delete;
  ~FpTrap() { restore(before_); }

 private:
  friend class FpPause;
  static constexpr int kTrapped = FE_INVALID | FE_DIVBYZERO;

  static void restore(int traps) {
    std::feclearexcept(kTrapped);
    ::fedisableexcept(kTrapped);
    ::feenableexcept(traps & kTrapped);
  }
  int before_;
};

/// For tests: takes the traps away for GL calls and for what must see a NaN, and puts back what
/// was.
class FpPause {
 public:
  FpPause() : before_(::fegetexcept()) { ::fedisableexcept(FpTrap::kTrapped); }
  FpPause(const FpPause&) = delete;
  FpPause& operator=(const FpPause&) = delete;
  ~FpPause() { FpTrap::restore(before_); }

 private:
  int before_;
};

}  // namespace veneer
