// SPDX-License-Identifier: Apache-2.0
#include "capture/hands.h"

namespace veneer::capture {

std::string_view text_of(Target target) {
  switch (target) {
    case Target::kWhite:
      return "white";
    case Target::kMirror:
      return "mirror";
    case Target::kMirrorBall:
      return "mirror-ball";
    case Target::kSample:
      break;
  }
  return "sample";
}

}  // namespace veneer::capture
