// SPDX-License-Identifier: Apache-2.0
#include "render/renderer.h"

#include <time.h>

#include <algorithm>
#include <chrono>
#include <optional>
#include <utility>

#include "render/compensate_pass.h"
#include "render/egl_context.h"
#include "render/gpu_timer.h"
#include "render/level_draws.h"
#include "render/mesh_buffers.h"
#include "render/prepared_profile.h"
#include "render/scanout_buffers.h"
#include "render/scanout_pass.h"
#include "render/scene_check.h"

namespace veneer::render {
namespace {

/// What this thread has computed so far.
std::chrono::nanoseconds thread_time() {
  timespec used{};
  ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &used);
  return std::chrono::seconds(used.tv_sec) + std::chrono::nanoseconds(used.tv_nsec);
}

// In single precision, as GL gets it.
bool fits(const Eigen::Vector3d& v) { return v.cast<float>().allFinite(); }

// Whether a frame can be drawn from it. What GL makes of vertices that are no numbers, and a
// material of such an eye, is anybody's guess.
bool is_sound(const FrameInput& input) {
  return fits(input.eye_in_world) && fits(input.world_from_object.translation) &&
         input.world_from_object.rotation.coeffs().cast<float>().allFinite() &&
         input.specular_weight >= 0.0 && input.specular_weight <= 1.0 && input.fade >= 0.0 &&
         input.fade <= 1.0;
}

class GlRenderer final : public Renderer {
 public:
  static Result<std::unique_ptr<Renderer>> create(EglContext context,
                                                  const Scene& scene,
                                                  std::span<const Level> levels,
                                                  const PreparedProfile& prepared,
                                                  const RendererOptions& options,
                                                  const Scanout* scanout) {
    VENEER_ASSIGN(LevelDraws draws, LevelDraws::create(scene, levels, prepared.profile()));
    VENEER_ASSIGN(CompensatePass compensate,
                  CompensatePass::create(prepared, options.exchangeable));
    auto renderer = std::unique_ptr<GlRenderer>(new GlRenderer(
        std::move(context), scene.mesh, prepared, std::move(draws), std::move(compensate)));
    // Of one level alone the first frame compiles what is left, as it always has.
    if (levels.size() > 1) renderer->draws_.warm_up(renderer->mesh_);
    if (scanout != nullptr) VENEER_TRY(renderer->import(*scanout));
    return renderer;
  }

  ~GlRenderer() override { context_.make_current(); }

  void release() override { context_.release(); }

  bool lost() override { return context_.lost(); }

  void draw_to_scanout(std::size_t buffer) override {
    VENEER_CHECK(scanout_pass_ && buffer < scanout_buffers_.size());
    context_.make_current();
    scanout_pass_->run(compensate_.codes(),
                       scanout_buffers_.framebuffer(buffer),
                       scanout_buffers_.bits(buffer),
                       width_,
                       height_);
    glFlush();
  }

  Status set_profile(const PreparedProfile& prepared) override {
    VENEER_TRY(check_exchangeable({width_, height_, bits_}, prepared.profile()));
    // A bright fault is the worst: no profile lifts the ceiling by mistake.
    const double ceiling = prepared.compensation().ceiling().nits();
    if (ceiling != ceiling_)
      return fail(
          Errc::kInvalidOption,
          "exchanging the profile: it was prepared for a luminance ceiling of {} cd/m^2, and "
          "the picture has one of {}; restart to change it",
          ceiling,
          ceiling_);
    context_.make_current();
    VENEER_TRY(compensate_.set_profile(prepared));
    draws_.set_projector(prepared.profile());
    return {};
  }

  void draw(const FrameInput& input) override {
    context_.make_current();
    const std::chrono::nanoseconds begin = software_ ? thread_time() : std::chrono::nanoseconds{};
    timer_.begin();
    if (is_sound(input)) {
      draws_.draw(mesh_, input);
    } else {
      draws_.clear();
    }
    timer_.split();
    compensate_.run(draws_.target().colour(), input.dither_seed);
    timer_.end();
    glFlush();
    if (software_)
      software_ms_ = std::chrono::duration<double, std::milli>(thread_time() - begin).count();
  }

  void read_codes(ImageView<Rgb16> codes) override {
    static_assert(sizeof(Rgb16) == 3 * sizeof(std::uint16_t));
    read(compensate_.framebuffer(), GL_RGB_INTEGER, GL_UNSIGNED_SHORT, codes);
  }

  void read_target(ImageView<Rgb32f> target_xyz) override {
    static_assert(sizeof(Rgb32f) == 3 * sizeof(float));
    read(draws_.target().framebuffer(), GL_RGB, GL_FLOAT, target_xyz);
  }

  void finish() override {
    context_.make_current();
    glFinish();
  }

  FrameStatistics statistics() override {
    context_.make_current();
    const CompensatePass::Counts& counts = compensate_.counts();
    FrameStatistics statistics;
    statistics.covered_pixels = counts.covered;
    statistics.out_of_gamut_pixels = counts.out_of_gamut;
    statistics.out_of_reach_pixels = counts.out_of_reach;
    statistics.held_pixels = counts.held;
    if (counts.covered > 0)
      statistics.gamut_loss_mean = counts.gamut_loss / static_cast<double>(counts.covered);
    if (const auto times = timer_.times()) {
      statistics.gpu_ms = times->all_ms;
      statistics.draw_ms = times->first_ms;
    }
    if (software_) statistics.software_ms = software_ms_;
    return statistics;
  }

  std::string description() const override { return context_.description(); }

 private:
  GlRenderer(EglContext context,
             const Mesh& mesh,
             const PreparedProfile& prepared,
             LevelDraws draws,
             CompensatePass compensate)
      : context_(std::move(context)),
        width_(prepared.profile().geometry.width),
        height_(prepared.profile().geometry.height),
        bits_(prepared.profile().bits),
        ceiling_(prepared.compensation().ceiling().nits()),
        software_(context_.is_software()),
        mesh_(mesh),
        draws_(std::move(draws)),
        compensate_(std::move(compensate)) {}

  Status import(const Scanout& scanout) {
    VENEER_ASSIGN(scanout_pass_, ScanoutPass::create(bits_));
    VENEER_ASSIGN(scanout_buffers_,
                  ScanoutBuffers::import(context_, scanout.buffers, {width_, height_, bits_}));
    return {};
  }

  // Rows come as they lie in the framebuffer, whose row 0 is the raster's first
  // (clip_from_projector).
  template <class Pixel>
  void read(GLuint framebuffer, GLenum format, GLenum type, ImageView<Pixel> pixels) {
    VENEER_CHECK(pixels.width() == width_ && pixels.height() == height_);
    context_.make_current();
    glBindFramebuffer(GL_READ_FRAMEBUFFER, framebuffer);
    glPixelStorei(GL_PACK_ALIGNMENT, 2);
    glPixelStorei(GL_PACK_ROW_LENGTH, static_cast<GLint>(pixels.stride()));
    glReadPixels(0, 0, width_, height_, format, type, pixels.data());
    // What a lost GPU leaves in a picture may be anything: nothing of it goes further.
    if (context_.lost())
      for (int y = 0; y < height_; ++y) std::ranges::fill(pixels.row(y), black_pixel<Pixel>());
  }

  EglContext context_;  // first, so that it goes last
  int width_;
  int height_;
  int bits_;
  double ceiling_;
  bool software_;
  double software_ms_ = 0;
  MeshBuffers mesh_;
  LevelDraws draws_;
  CompensatePass compensate_;
  GpuTimer timer_;
  ScanoutBuffers scanout_buffers_;
  std::optional<ScanoutPass> scanout_pass_;  // where there are buffers
};

}  // namespace

Result<std::unique_ptr<Renderer>> Renderer::create(const Scene& scene,
                                                   std::span<const Level> levels,
                                                   const calibration::ProjectorProfile& profile,
                                                   const RendererOptions& options,
                                                   const Scanout* scanout) {
  VENEER_TRY(check_drawable(scene));
  auto prepared = PreparedProfile::prepare(profile, options);
  if (!prepared) return fail_while("making a renderer", prepared.error());
  if (scanout != nullptr && scanout->gbm_device == nullptr)
    return fail(
        Errc::kUnavailable,
        "making a renderer: the display has no GBM device, of which EGL could draw into its "
        "buffers");
  VENEER_ASSIGN(
      EglContext context,
      scanout != nullptr ? EglContext::create_on(scanout->gbm_device) : EglContext::create());
  return GlRenderer::create(std::move(context), scene, levels, *prepared, options, scanout);
}

}  // namespace veneer::render
