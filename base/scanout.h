// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

namespace veneer {

/// Memory of a display that a GPU can draw into: one plane of pixels.
struct DmaBuffer {
  int descriptor = -1;  ///< a dma-buf, borrowed from whoever made it
  int width = 0;
  int height = 0;
  std::uint32_t format = 0;    ///< as in drm_fourcc.h: XRGB8888 or XRGB2101010
  std::uint32_t stride = 0;    ///< bytes from row to row
  std::uint32_t offset = 0;    ///< bytes
  std::uint64_t modifier = 0;  ///< as in drm_fourcc.h
};

/// What a renderer needs to know of a display into whose buffers it draws.
struct Scanout {
  void* gbm_device = nullptr;      ///< struct gbm_device*, of which EGL makes its display; borrowed
  std::vector<DmaBuffer> buffers;  ///< one is shown, one waits, one is drawn into
};

}  // namespace veneer
