// SPDX-License-Identifier: Apache-2.0
#include "cli/governor/load.h"

#include <gtest/gtest.h>
#include <sys/resource.h>

#include "base/clock.h"

namespace veneer::cli {
namespace {

using namespace std::chrono_literals;

double processor_seconds() {
  rusage usage{};
  ::getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_utime.tv_sec) +
         1e-6 * static_cast<double>(usage.ru_utime.tv_usec);
}

TEST(BusyThreads, WantProcessorsUntilTheyAreDestroyed) {
  SteadyClock clock;
  const double before = processor_seconds();
  {
    const BusyThreads load(2);
    // Others may have the processors for a while.
    for (int i = 0; i < 100 && processor_seconds() - before < 0.1; ++i)
      clock.sleep_until(clock.now() + 100ms);
  }
  const double after = processor_seconds();
  EXPECT_GE(after - before, 0.1);
  clock.sleep_until(clock.now() + 200ms);
  EXPECT_LT(processor_seconds() - after, 0.05) << "nothing is busy any more";
}

TEST(OtherPrograms, AreNotOurselves) {
  const OtherPrograms others;
  SteadyClock clock;
  {
    const BusyThreads load(1);
    clock.sleep_until(clock.now() + 300ms);
  }
  const std::optional<double> share = others.share();
  if (!share) GTEST_SKIP() << "this kernel does not tell what processors do";
  EXPECT_GE(*share, 0.0);
  EXPECT_LE(*share, 1.0);
}

}  // namespace
}  // namespace veneer::cli
