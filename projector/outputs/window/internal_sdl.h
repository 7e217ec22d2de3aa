// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "base/result.h"

namespace veneer::projector {

/// SDL's video, begun with the first of these and ended with the last. One thread.
class SdlVideo {
 public:
  /// Errors: kUnavailable (no desktop).
  [[nodiscard]] static Result<SdlVideo> begin();

 private:
  struct End {
    void operator()(const void*) const noexcept;
  };
  explicit SdlVideo(const void* token) : token_(token) {}
  std::unique_ptr<const void, End> token_;
};

}  // namespace veneer::projector
