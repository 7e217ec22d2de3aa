// SPDX-License-Identifier: Apache-2.0
#include "render/draw_pass.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <numbers>

#include "base/colour.h"

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

// The block Frame of frame.glsl, with room for every light; a program reads as much as it declares.
struct FrameBlock {
  Eigen::Matrix4f clip_from_object;
  Eigen::Matrix4f xyz_from_rgb;
  Eigen::Vector4f eye;
  Eigen::Vector4f projector;
  Eigen::Vector2f texture_repeats;
  float specular_weight;
  float unused;
  std::array<Eigen::Vector4f, 2 * kMaxLights> lights;  // lights[n], then light_rgb[n]
};
static_assert(offsetof(FrameBlock, lights) == 2 * 64 + 3 * 16);

std::string header(int light_count) {
  return fmt::format("#version 450 core\n#define LIGHT_COUNT {}\n", light_count) + kFrameGlsl;
}

Eigen::Vector4f homogeneous(const Eigen::Vector3d& v, double w) {
  return Eigen::Vector4d(v.x(), v.y(), v.z(), w).cast<float>();
}

struct LightUniform {
  Eigen::Vector4f light;
  Eigen::Vector4f rgb;
};

LightUniform uniform_of(const Light& light, const RigidTransform& object_from_world) {
  // A material's sample is its radiance times pi over the irradiance.
  if (const auto* sun = std::get_if<DirectionalLight>(&light))
    return {homogeneous(object_from_world.rotation * sun->direction_to_light, 0.0),
            homogeneous(sun->illuminance_rgb / std::numbers::pi, 0.0)};
  const auto& lamp = std::get<PointLight>(light);
  return {homogeneous(object_from_world * lamp.position, 1.0),
          homogeneous(lamp.intensity_rgb / std::numbers::pi, 0.0)};
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

std::string draw_vertex_source(int light_count) { return header(light_count) + kDrawVert; }

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
                   const calibration::ProjectorProfile& profile)
    : uniforms_(make_buffer(nullptr, sizeof(FrameBlock), GL_DYNAMIC_STORAGE_BIT)),
      lights_(std::move(lights)),
      texture_repeats_(texture_repeats),
      width_(profile.geometry.width),
      height_(profile.geometry.height) {
  VENEER_CHECK(!lights_.empty() && lights_.size() <= kMaxLights);
  set_projector(profile);
}

void DrawPass::set_projector(const calibration::ProjectorProfile& profile) {
  VENEER_CHECK(profile.geometry.width == width_ && profile.geometry.height == height_);
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
  VENEER_ASSIGN(textures_, ModelTextures::upload(textures, program_.id()));
  return {};
}

Result<DrawPass> DrawPass::create(const btf::ModelShader& shader,
                                  std::vector<Light> lights,
                                  const Eigen::Vector2d& texture_repeats,
                                  const calibration::ProjectorProfile& profile,
                                  const DrawOptions& options) {
  VENEER_TRY(options.cache.check());
  const auto light_count = static_cast<int>(lights.size());
  DrawPass pass(std::move(lights), texture_repeats, profile);
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
  VENEER_ASSIGN(surface_, SurfaceBuffer::create(light_count, width_, height_));
  VENEER_ASSIGN(program_,
                link_program({{GL_COMPUTE_SHADER,
                               "draw.comp",
                               draw_compute_source(shader.source, light_count, options.filter)}}));
  VENEER_ASSIGN(textures_, ModelTextures::upload(shader, program_.id()));
  surface_->assign(program_.id(), static_cast<GLuint>(shader.textures.size()));
  return {};
}

Status DrawPass::add_cache(const btf::ModelShader& shader, const DrawOptions& options) {
  const auto light_count = static_cast<int>(lights_.size());
  VENEER_ASSIGN(cache_, AngularCache::create(shader, light_count, options.cache, width_, height_));
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
  const RigidTransform object_from_world = input.world_from_object.inverse();
  FrameBlock block;
  block.clip_from_object = (clip_from_world_ * input.world_from_object.matrix()).cast<float>();
  block.xyz_from_rgb = Eigen::Matrix4f::Identity();
  block.xyz_from_rgb.topLeftCorner<3, 3>() = xyz_from_srgb().cast<float>();
  block.eye = homogeneous(object_from_world * input.eye_in_world, 1.0);
  block.projector = homogeneous(object_from_world * projector_in_world_,
                                reference_distance_m_ * reference_distance_m_);
  block.texture_repeats = texture_repeats_.cast<float>();
  block.specular_weight = static_cast<float>(input.specular_weight);
  block.unused = 0.0F;
  for (std::size_t i = 0; i < lights_.size(); ++i) {
    const LightUniform light = uniform_of(lights_[i], object_from_world);
    block.lights[i] = light.light;
    block.lights[lights_.size() + i] = light.rgb;
  }
  glNamedBufferSubData(uniforms_.id(), 0, sizeof(block), &block);

  if (cache_) {
    block.clip_from_object =
        (cache_->nodes_from_clip() * clip_from_world_ * input.world_from_object.matrix())
            .cast<float>();
    glNamedBufferSubData(node_uniforms_.id(), 0, sizeof(block), &block);
    cache_->fill(mesh, textures_, uniforms_.id(), node_uniforms_.id());
  }

  glViewport(0, 0, width_, height_);
  glClipControl(GL_LOWER_LEFT, GL_ZERO_TO_ONE);
  glDisable(GL_BLEND);
  glEnable(GL_DEPTH_TEST);
  glDepthFunc(GL_GREATER);
  glClearDepth(0.0);
  if (surface_) {
    surface_->begin();
    use(surface_->program());
    mesh.draw();
    textures_.bind();
    use(program_.id());
    surface_->evaluate(framebuffer);
    return;
  }
  clear(framebuffer);
  textures_.bind();
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
