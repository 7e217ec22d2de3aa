// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <string>
#include <string_view>

#include "base/result.h"

namespace veneer::calibration {

/// Something that only hands can do.
enum class Task {
  kAimAtBoard,   ///< the colorimeter, at a white board
  kAimAtObject,  ///< the colorimeter, at the object's surface, in the board's place
  kCoverLens,    ///< so that only the room's light is left
  kUncoverLens,
  kPlaceBoard,  ///< the chequered board for the camera, in pose number `index`
  kRemoveBoard,
  kTouch,           ///< landmark number `index` of the object, with the tracked stylus
  kSeeToProjector,  ///< to a setting of the projector's own that may spoil colours; or go on
  kTouchSpot,       ///< the cross-hair that the projector shows at `pixel`, with the stylus
};

struct Request {
  Task task = Task::kAimAtBoard;
  int index = 0;
  std::string text;                                 ///< what to do, in words
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();  ///< of kTouchSpot, on the raster
};

enum class Answer {
  kDone,
  kAgain,  ///< do the step from its beginning
  kSkip,   ///< go on without this step
  kBack,   ///< to the step before
  kQuit,   ///< stop here; the session is kept
};

/// The person beside the projector, or what stands in for one: answers from a file, the virtual
/// bench's hands.
class Operator {
 public:
  virtual ~Operator() = default;
  /// Waits until it was done, or refused. Errors: what stands in the way (kUnavailable where nobody
  /// can do it).
  [[nodiscard]] virtual Result<Answer> please(const Request& request) = 0;
  /// After a step that went wrong; `why` has been said already.
  [[nodiscard]] virtual Result<Answer> after_failure(std::string_view step, const Error& why) = 0;
  virtual void say(std::string_view text) = 0;
};

}  // namespace veneer::calibration
