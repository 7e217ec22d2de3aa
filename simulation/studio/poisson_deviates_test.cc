// SPDX-License-Identifier: Apache-2.0
#include "simulation/studio/poisson_deviates.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

namespace veneer::simulation::studio {

namespace {

TEST(PoissonDeviates, HaveTheChancesOfPoissonsFormula) {
  const PoissonDeviates poisson;
  Pcg32 random(1);
  constexpr int kDraws = 200000;
  for (const double mean : {0.02, 0.7, 1.0, 3.7, 12.5, 29.99}) {
    std::vector<double> seen(200);
    for (int i = 0; i < kDraws; ++i)
      ++seen.at(static_cast<std::size_t>(poisson.draw(mean, random)));
    for (int k = 0; k < 80; ++k) {
      const double chance = std::exp(k * std::log(mean) - mean - std::lgamma(k + 1));
      // Five standard deviations of a count, and one count for the rare ones.
      EXPECT_NEAR(
          seen[static_cast<std::size_t>(k)], kDraws * chance, 5 * std::sqrt(kDraws * chance) + 1)
          << "mean " << mean << ", " << k << " electrons";
    }
  }
}

TEST(PoissonDeviates, NoLightGivesNoElectrons) {
  const PoissonDeviates poisson;
  Pcg32 random(1);
  for (const double mean : {0.0, -1.0, std::numeric_limits<double>::quiet_NaN()})
    for (int i = 0; i < 100; ++i) EXPECT_EQ(poisson.draw(mean, random), 0) << mean;
}

}  // namespace
}  // namespace veneer::simulation::studio
