// SPDX-License-Identifier: Apache-2.0
#pragma once

// Internal to render/.

#include <array>
#include <cstdint>
#include <string>

#include "base/image.h"
#include "render/compensation.h"
#include "render/gl_objects.h"
#include "render/prepared_profile.h"

namespace veneer::render {

/// What the compensate pass does; a program each.
enum class CompensateKind {
  kNone,      ///< without RendererOptions::compensate
  kPlain,     ///< tone curves and one matrix
  kResidual,  ///< with the profile's colour residual
};
/// The complete source of the compensate pass.
/// @param has_ceiling  with RendererOptions::luminance_ceiling; a program of its own, so that it
///                     costs nothing where there is none.
[[nodiscard]] std::string compensate_fragment_source(CompensateKind kind, bool has_ceiling = false);
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
    std::uint64_t held = 0;
    double gamut_loss = 0;  ///< sum over the pixels
  };

  /// @param exchangeable  compiles at once what any other profile may need, so that set_profile()
  ///                      leaves no work to the frame after it.
  /// Errors: kUnavailable (the driver refuses a shader).
  [[nodiscard]] static Result<CompensatePass> create(const PreparedProfile& profile,
                                                     bool exchangeable = false);
  CompensatePass(CompensatePass&&) noexcept = default;
  CompensatePass& operator=(CompensatePass&&) = delete;
  ~CompensatePass();

  /// From the next run on, another profile of the same raster (checked), prepared with the same
  /// options. Errors: kUnavailable (the driver refuses a shader); the old one stays.
  [[nodiscard]] Status set_profile(const PreparedProfile& profile);
  /// @param target  RGBA16F or RGBA32F texture of the raster's size.
  void run(GLuint target, std::uint32_t dither_seed);
  /// The framebuffer whose colour attachment (RGBA16UI) holds the codes of the last run.
  [[nodiscard]] GLuint framebuffer() const { return framebuffer_.id(); }
  [[nodiscard]] GLuint codes() const { return codes_.id(); }
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
  // What a kind of compensation is drawn by; linked when it is first needed.
  struct Program {
    GlProgram program;
    GLint seed_location = -1;
  };
  // What is made of one profile.
  struct ProfileTextures {
    GlBuffer constants;
    GlTexture seeds;
    GlTexture levels;
    GlTexture vignetting;
    GlTexture reflectance;
    GlTexture correction;  // none without a residual
    GlTexture light;       // none without a ceiling
    GlTexture residual;    // none without both
  };
  CompensatePass() = default;
  [[nodiscard]] Status link(CompensateKind kind);
  [[nodiscard]] Status warm_up();
  static ProfileTextures upload(const PreparedProfile& profile);
  // What a draw binds beside the profile's other textures.
  struct Bound {
    CompensateKind kind;
    GLuint target;
    GLuint reflectance;
    GLuint correction;
    GLuint residual;
  };
  void compensate(const Bound& bound, std::uint32_t dither_seed, int width, int height);

  std::array<Program, 3> programs_;  // indexed by CompensateKind
  CompensateKind kind_ = CompensateKind::kPlain;
  bool has_ceiling_ = false;
  ProfileTextures profile_;
  GlProgram count_program_;
  GlBuffer counters_;  // kRing slots, mapped for good
  GlTexture codes_;
  GlFramebuffer framebuffer_;
  GlVertexArray no_vertices_;
  GLintptr slot_bytes_ = 0;
  int width_ = 0;
  int height_ = 0;
  std::array<InFlight, kRing> ring_;
  std::uint64_t frame_ = 0;
  std::uint64_t newest_counted_ = 0;
  Counts counts_;
};

}  // namespace veneer::render
