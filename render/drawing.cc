// SPDX-License-Identifier: Apache-2.0
#include "render/drawing.h"

namespace veneer::render {

Status DrawingOptions::check() const {
  VENEER_TRY(cache.check());
  if (!(scale >= kLeastScale && scale <= 1.0))
    return fail(Errc::kInvalidOption,
                "the scale at which is drawn is {}; it must be from {} to 1",
                scale,
                kLeastScale);
  return {};
}

}  // namespace veneer::render
