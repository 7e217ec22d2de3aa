// SPDX-License-Identifier: Apache-2.0
#include "simulation/studio/poisson_deviates.h"

#include <algorithm>
#include <cmath>

namespace veneer::simulation::studio {

PoissonDeviates::PoissonDeviates() {
  for (int mean = 1; mean <= kMost; ++mean) {
    std::vector<double>& cumulative = cumulative_[static_cast<std::size_t>(mean)];
    double chance = std::exp(-mean);
    double sum = chance;
    // Until what is left is far below what a random number of 32 bits tells apart.
    for (int k = 1; k <= mean || chance > 1e-14; ++k) {
      cumulative.push_back(sum);
      chance *= static_cast<double>(mean) / k;
      sum += chance;
    }
  }
}

int PoissonDeviates::draw(double mean, Pcg32& random) const {
  if (!(mean > 0)) return 0;
  // The sum of two Poisson numbers is one, of the sum of their means.
  const int whole = std::min(static_cast<int>(mean), kMost);
  int sum = 0;
  if (whole > 0) {
    const std::vector<double>& cumulative = cumulative_[static_cast<std::size_t>(whole)];
    sum += static_cast<int>(std::ranges::upper_bound(cumulative, random.uniform()) -
                            cumulative.begin());
  }
  const double rest = mean - whole;
  double chance = std::exp(-rest);
  double left = random.uniform() - chance;
  for (int k = 1; left >= 0 && k <= kMost; ++k) {
    chance *= rest / k;
    left -= chance;
    ++sum;
  }
  return sum;
}

}  // namespace veneer::simulation::studio
