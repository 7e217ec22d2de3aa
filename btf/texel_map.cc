// SPDX-License-Identifier: Apache-2.0
#include "btf/texel_map.h"

#include <algorithm>
#include <utility>

namespace veneer::btf {

Result<TexelMap> TexelMap::create(
    int width, int height, std::vector<Source> sources, int sample_width, int sample_height) {
  constexpr std::string_view kWhat = "a texel map";
  if (width < 1 || height < 1 || width > kMostSide || height > kMostSide)
    return fail(Errc::kBadFormat,
                "{} of {} x {} places: a side may have 1 to {}",
                kWhat,
                width,
                height,
                kMostSide);
  if (sources.size() != static_cast<std::size_t>(width) * static_cast<std::size_t>(height))
    return fail(Errc::kBadFormat,
                "{} of {} x {} places names {} texels",
                kWhat,
                width,
                height,
                sources.size());
  const auto bad = std::ranges::find_if(
      sources, [&](const Source& s) { return s[0] >= sample_width || s[1] >= sample_height; });
  if (bad != sources.end())
    return fail(Errc::kBadFormat,
                "{}: place {} shows texel ({}, {}) of a sample of {} x {}",
                kWhat,
                bad - sources.begin(),
                (*bad)[0],
                (*bad)[1],
                sample_width,
                sample_height);
  TexelMap map;
  map.width_ = width;
  map.height_ = height;
  map.sample_width_ = sample_width;
  map.sample_height_ = sample_height;
  map.sources_ = std::move(sources);
  return map;
}

}  // namespace veneer::btf
