// SPDX-License-Identifier: Apache-2.0
#pragma once

// Internal to render/.

#include <array>
#include <cstdint>
#include <string>

#include "base/image.h"
#include "render/compensation.h"
#include "render/gl_objects.h"

namespace veneer::render {

/// The complete source of the compensate pass; `compensate` as in RendererOptions.
[[nodiscard]] std::string compensate_fragment_source(bool compensate);
/// The complete sources of the pass's other stages.
[[nodiscard]] std::string fullscreen_vertex_source();
[[nodiscard]] std::string count_compute_source();

/// Turns a drawn target into codes, on the GPU, and counts. Needs a current context, always the
/// same.
class CompensatePass {
 public:
  /// What the pass counted in one frame.
  struct Counts {
    std::uint64_t covered = 0;
    std::uint64_t out_of_gamut = 0;
    std::uint64_t out_of_reach = 0;
    double gamut_loss = 0;  ///< sum over the pixels
  };

  /// @param profile  the one that `compensation` was made of.
  /// Errors: kUnavailable (the driver refuses a shader).
  [[nodiscard]] static Result<CompensatePass> create(const Compensation& compensation,
                                                     const calibration::ProjectorProfile& profile);
  CompensatePass(CompensatePass&&) noexcept = default;
  CompensatePass& operator=(CompensatePass&&) = delete;
  ~CompensatePass();

  /// @param target  RGBA16F or RGBA32F texture of the raster's size.
  void run(GLuint target, std::uint32_t dither_seed);
  /// The framebuffer whose colour attachment (RGBA16UI) holds the codes of the last run.
  [[nodiscard]] GLuint framebuffer() const { return framebuffer_.id(); }
  /// Of the newest frame that the GPU is done with; never waits.
  [[nodiscard]] const Counts& counts();

 private:
  // A frame whose counts are on their way. The ring is as long as GPUs run behind.
  struct InFlight {
    const volatile std::uint32_t* mapped = nullptr;
    GLsync fence = nullptr;
    std::uint64_t number = 0;
  };
  static constexpr std::size_t kRing = 4;
  CompensatePass() = default;

  GlProgram program_;
  GlProgram count_program_;
  GlBuffer constants_;
  GlTexture seeds_;
  GlTexture levels_;
  GlBuffer counters_;  // kRing slots, mapped for good
  GlTexture vignetting_;
  GlTexture reflectance_;
  GlTexture codes_;
  GlFramebuffer framebuffer_;
  GlVertexArray no_vertices_;
  GLint seed_location_ = -1;
  GLintptr slot_bytes_ = 0;
  int width_ = 0;
  int height_ = 0;
  std::array<InFlight, kRing> ring_;
  std::uint64_t frame_ = 0;
  std::uint64_t newest_counted_ = 0;
  Counts counts_;
};

}  // namespace veneer::render
