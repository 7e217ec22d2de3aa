// SPDX-License-Identifier: Apache-2.0
#include "btf/spread_texels.h"

#include <cmath>
#include <numeric>

namespace veneer::btf {

std::vector<int> spread_texels(const SampleSetInfo& info, int wanted) {
  std::vector<int> texels;
  if (wanted >= info.texel_count()) {
    texels.resize(static_cast<std::size_t>(info.texel_count()));
    std::iota(texels.begin(), texels.end(), 0);
    return texels;
  }
  for (int i = 1; i <= wanted; ++i) {
    const auto fraction = [i](double alpha) { return std::fmod(i * alpha, 1.0); };
    const int x = static_cast<int>(fraction(0.7548776662466927) * info.width);
    const int y = static_cast<int>(fraction(0.5698402909980532) * info.height);
    texels.push_back(y * info.width + x);
  }
  return texels;
}

}  // namespace veneer::btf
