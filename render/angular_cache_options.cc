// SPDX-License-Identifier: Apache-2.0
#include "render/angular_cache_options.h"

namespace veneer::render {

Status AngularCacheOptions::check() const {
  if (spacing != 0 && (spacing < 4 || spacing > 128))
    return fail(Errc::kInvalidOption,
                "angular cache: the spacing is {} pixels; it must be 0 (none) or 4 to 128",
                spacing);
  if (!(most_turn > 0.0 && most_turn <= 1.0))
    return fail(Errc::kInvalidOption,
                "angular cache: most_turn is {}; it must be above 0, at most 1",
                most_turn);
  return {};
}

}  // namespace veneer::render
