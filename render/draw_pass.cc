// SPDX-License-Identifier: Apache-2.0
#include "render/draw_pass.h"

#include <algorithm>

#include "render/frame_block.h"

namespace veneer::render {
namespace {

constexpr char kFrameGlsl[] =
#include "render/shaders/frame.glsl.inc"
    ;
constexpr char kSurfaceGlsl[] =
#include "render/shaders/surface.glsl.inc"
    ;
constexpr char kDrawVert[] =
#include "render/shaders/draw.vert.inc"
    ;
constexpr char kDrawFrag[] =
#include "render/shaders/draw.frag.inc"
    ;

constexpr char kPlainFrag[] =
#include "render/shaders/plain.frag.inc"
    ;
constexpr char kProbeFrag[] =
#include "render/shaders/probe.frag.inc"
    ;

std::string header(int light_count) {
  return fmt::format("#version 450 core\n#define LIGHT_COUNT {}\n", light_count) + kFrameGlsl;
}

}  // namespace

Eigen::Matrix4d clip_from_projector(const calibration::ProjectorGeometry& g) {
  Eigen::Matrix4d m = Eigen::Matrix4d::Zero();
  m(0, 0) = 2.0 * g.fx / g.width;
  m(0, 2) = 2.0 * g.cx / g.width - 1.0;
  m(1, 1) = 2.0 * g.fy / g.height;
  m(1, 2) = 2.0 * g.cy / g.height - 1.0;
  m(2, 3) = kNearPlane;
  m(3, 2) = 1.0;
  return m;
}

std::string draw_vertex_source(int light_count, Surfaces surfaces) {
  return header(light_count) + (surfaces == Surfaces::kShells ? "#define SHELLS\n" : "") +
         kDrawVert;
}

std::string surface_header(int light_count) { return header(light_count) + kSurfaceGlsl; }

std::string draw_fragment_source(const std::string& model_source,
                                 int light_count,
                                 const TexelFilter& filter) {
  return surface_header(light_count) + model_source + "\n" +
         radiance_source("btf_radiance(uv, view, light)", filter) + kDrawFrag;
}

std::string plain_fragment_source(int light_count, bool point_lights) {
  return surface_header(light_count) + (point_lights ? "#define POINT_LIGHTS\n" : "") + kPlainFrag;
}

std::string probe_fragment_source(int light_count) {
  return surface_header(light_count) + kProbeFrag;
}

DrawPass::DrawPass(std::vector<Light> lights,
                   const Eigen::Vector2d& texture_repeats,
                   const calibration::ProjectorProfile& profile,
                   double scale)
    : uniforms_(make_buffer(nullptr, sizeof(FrameBlock), GL_DYNAMIC_STORAGE_BIT)),
      lights_(std::move(lights)),
      texture_repeats_(texture_repeats),
      projector_raster_(profile.geometry.width, profile.geometry.height),
      raster_(scaled_raster(projector_raster_, scale)) {
  VENEER_CHECK(!lights_.empty() && lights_.size() <= kMaxLights);
  set_projector(profile);
}

void DrawPass::set_projector(const calibration::ProjectorProfile& profile) {
  VENEER_CHECK(profile.geometry.width == projector_raster_.x() &&
               profile.geometry.height == projector_raster_.y());
  clip_from_world_ = clip_from_projector(profile.geometry) *
                     profile.geometry.world_from_projector.inverse().matrix();
  projector_in_world_ = profile.geometry.world_from_projector.translation;
  reference_distance_m_ = profile.reference_distance_m;
}

Status DrawPass::link(const std::string& fragment_source, const btf::ModelShader& textures) {
  VENEER_ASSIGN(
      program_,
      link_program(
          {{GL_VERTEX_SHADER, "draw.vert", draw_vertex_source(static_cast<int>(lights_.size()))},
           {GL_FRAGMENT_SHADER, "draw.frag, plain.frag or probe.frag", fragment_source}}));
  return provide(textures);
}

// What the program reads: uploaded, where no other pass did, and told to it.
Status DrawPass::provide(const btf::ModelShader& textures) {
  if (textures_ == nullptr) {
    VENEER_ASSIGN(ModelTextures uploaded, ModelTextures::upload(textures));
    textures_ = std::make_shared<const ModelTextures>(std::move(uploaded));
  }
  ModelTextures::assign_units(textures, program_.id());
  return {};
}

Result<DrawPass> DrawPass::create(const btf::ModelShader& shader,
                                  std::vector<Light> lights,
                                  const Eigen::Vector2d& texture_repeats,
                                  const calibration::ProjectorProfile& profile,
                                  const DrawOptions& options,
                                  Textures textures) {
  VENEER_TRY(options.cache.check());
  const auto light_count = static_cast<int>(lights.size());
  DrawPass pass(std::move(lights), texture_repeats, profile, options.scale);
  pass.textures_ = std::move(textures);
  if (options.evaluation == Evaluation::kCompute) {
    VENEER_TRY(pass.link_compute(shader, options));
    return pass;
  }
  VENEER_TRY(pass.link(draw_fragment_source(shader.source, light_count, options.filter), shader));
  if (options.cache.spacing > 0 && shader.cache) VENEER_TRY(pass.add_cache(shader, options));
  return pass;
}

Status DrawPass::link_compute(const btf::ModelShader& shader, const DrawOptions& options) {
  if (options.cache.spacing > 0)
    return fail(Errc::kInvalidOption,
                "evaluation in a compute pass does not use the angular cache; set its spacing to 0 "
                "or evaluate in the fragment stage");
  const auto light_count = static_cast<int>(lights_.size());
  VENEER_ASSIGN(surface_, SurfaceBuffer::create(light_count, raster_.x(), raster_.y()));
  VENEER_ASSIGN(program_,
                link_program({{GL_COMPUTE_SHADER,
                               "draw.comp",
                               draw_compute_source(shader.source, light_count, options.filter)}}));
  VENEER_TRY(provide(shader));
  surface_->assign(program_.id(), static_cast<GLuint>(shader.textures.size()));
  return {};
}

Status DrawPass::add_cache(const btf::ModelShader& shader, const DrawOptions& options) {
  const auto light_count = static_cast<int>(lights_.size());
  VENEER_ASSIGN(cache_,
                AngularCache::create(shader, light_count, options.cache, raster_.x(), raster_.y()));
  VENEER_ASSIGN(cached_program_,
                link_program({{GL_VERTEX_SHADER, "draw.vert", draw_vertex_source(light_count)},
                              {GL_FRAGMENT_SHADER,
                               "draw_cached.frag",
                               draw_cached_fragment_source(
                                   shader, light_count, options.cache.spacing, options.filter)}}));
  ModelTextures::assign_units(shader, cached_program_.id());
  cache_->assign(cached_program_.id());
  node_uniforms_ = make_buffer(nullptr, sizeof(FrameBlock), GL_DYNAMIC_STORAGE_BIT);
  return {};
}

Result<DrawPass> DrawPass::create_plain(const btf::ModelShader& textures,
                                        std::vector<Light> lights,
                                        const Eigen::Vector2d& texture_repeats,
                                        const calibration::ProjectorProfile& profile) {
  const auto light_count = static_cast<int>(lights.size());
  const bool point_lights = std::ranges::any_of(
      lights, [](const Light& light) { return std::holds_alternative<PointLight>(light); });
  DrawPass pass(std::move(lights), texture_repeats, profile);
  VENEER_TRY(pass.link(plain_fragment_source(light_count, point_lights), textures));
  return pass;
}

Result<DrawPass> DrawPass::create_probe(std::vector<Light> lights,
                                        const Eigen::Vector2d& texture_repeats,
                                        const calibration::ProjectorProfile& profile) {
  const auto light_count = static_cast<int>(lights.size());
  DrawPass pass(std::move(lights), texture_repeats, profile);
  VENEER_TRY(pass.link(probe_fragment_source(light_count), {}));
  return pass;
}

void DrawPass::draw(GLuint framebuffer, const MeshBuffers& mesh, const DrawInput& input) const {
  draw(framebuffer, mesh, input, nullptr);
}

void DrawPass::draw(GLuint framebuffer,
                    const MeshBuffers& mesh,
                    const DrawInput& input,
                    const DrawMask& mask) const {
  draw(framebuffer, mesh, input, &mask);
}

void DrawPass::draw(GLuint framebuffer,
                    const MeshBuffers& mesh,
                    const DrawInput& input,
                    const DrawMask* mask) const {
  FrameBlock block = frame_block(lights_,
                                 texture_repeats_,
                                 clip_from_world_,
                                 projector_in_world_,
                                 reference_distance_m_,
                                 input);
  glNamedBufferSubData(uniforms_.id(), 0, sizeof(block), &block);

  if (cache_) {
    block.clip_from_object =
        (cache_->nodes_from_clip() * clip_from_world_ * input.world_from_object.matrix())
            .cast<float>();
    glNamedBufferSubData(node_uniforms_.id(), 0, sizeof(block), &block);
    cache_->fill(mesh, *textures_, uniforms_.id(), node_uniforms_.id());
  }

  glViewport(0, 0, raster_.x(), raster_.y());
  glClipControl(GL_LOWER_LEFT, GL_ZERO_TO_ONE);
  glDisable(GL_BLEND);
  glEnable(GL_DEPTH_TEST);
  glDepthFunc(GL_GREATER);
  glClearDepth(0.0);
  if (surface_) {
    surface_->begin();
    if (mask != nullptr) mask->write();
    use(surface_->program());
    mesh.draw();
    textures_->bind();
    use(program_.id());
    surface_->evaluate(framebuffer, mask != nullptr);
    return;
  }
  if (mask == nullptr) {
    clear(framebuffer);
  } else {
    glBindFramebuffer(GL_FRAMEBUFFER, framebuffer);
    mask->write();
  }
  textures_->bind();
  if (cache_) {
    cache_->bind();
    use(cached_program_.id());
    mesh.draw_sorted(MeshBuffers::List::kCached);
    use(program_.id());
    mesh.draw_sorted(MeshBuffers::List::kPerPixel);
  } else {
    use(program_.id());
    mesh.draw();
  }
}

void DrawPass::clear(GLuint framebuffer) const {
  glBindFramebuffer(GL_FRAMEBUFFER, framebuffer);
  glClearColor(0.0F, 0.0F, 0.0F, 0.0F);
  glClearDepth(0.0);
  glClear(GL_COLOR_BUFFER_BIT | GL_DEPTH_BUFFER_BIT);
}

void DrawPass::use(GLuint program) const {
  glUseProgram(program);
  glBindBufferBase(GL_UNIFORM_BUFFER, 0, uniforms_.id());
}

}  // namespace veneer::render
