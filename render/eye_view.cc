// SPDX-License-Identifier: Apache-2.0
#include "render/eye_view.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "render/draw_pass.h"
#include "render/egl_context.h"
#include "render/scene_check.h"
#include "render/shell_pass.h"

namespace veneer::render {
namespace {

using Eigen::Vector3d;

constexpr double kMargin = 1.05;  // of the ball in the picture

struct Ball {
  Vector3d centre;  // object's frame
  double radius;
};

Ball ball_about(const Mesh& mesh) {
  Eigen::AlignedBox3d box;
  for (const Vector3d& position : mesh.positions) box.extend(position);
  double radius = 0;
  for (const Vector3d& position : mesh.positions)
    radius = std::max(radius, (position - box.center()).norm());
  return {box.center(), radius};
}

// The mean of `samples` x `samples` pixels of what was drawn.
EyePicture mean_of(const std::vector<Eigen::Vector4f>& drawn, const EyeView& view) {
  EyePicture picture{
      Image<Rgb32f>(view.width, view.height), Image<float>(view.width, view.height), std::nullopt};
  const auto samples = static_cast<std::size_t>(view.samples);
  const std::size_t stride = samples * static_cast<std::size_t>(view.width);
  const float share = 1.0F / static_cast<float>(view.samples * view.samples);
  for (int y = 0; y < view.height; ++y) {
    for (int x = 0; x < view.width; ++x) {
      Eigen::Vector4f sum = Eigen::Vector4f::Zero();
      const std::size_t first =
          samples * (static_cast<std::size_t>(y) * stride + static_cast<std::size_t>(x));
      for (std::size_t j = 0; j < samples; ++j)
        for (std::size_t i = 0; i < samples; ++i) sum += drawn[first + j * stride + i];
      picture.radiance_xyz(x, y) = share * sum.head<3>();
      picture.hidden(x, y) = share * sum.w();
    }
  }
  return picture;
}

std::vector<Eigen::Vector4f> read(GLuint framebuffer, const calibration::ProjectorGeometry& g) {
  std::vector<Eigen::Vector4f> pixels(static_cast<std::size_t>(g.width) *
                                      static_cast<std::size_t>(g.height));
  glBindFramebuffer(GL_READ_FRAMEBUFFER, framebuffer);
  glPixelStorei(GL_PACK_ALIGNMENT, 4);
  glPixelStorei(GL_PACK_ROW_LENGTH, 0);
  glReadPixels(0, 0, g.width, g.height, GL_RGBA, GL_FLOAT, pixels.data());
  return pixels;
}

Result<std::vector<Eigen::Vector4f>> draw_shells(const Scene& scene,
                                                 const btf::ModelShader& shader,
                                                 const calibration::ProjectorGeometry& geometry,
                                                 double texel_m,
                                                 const DrawInput& input) {
  VENEER_ASSIGN(const ShellPass pass,
                ShellPass::create(shader, scene.lights, scene.texture_repeats, geometry, texel_m));
  pass.draw(MeshBuffers(scene.mesh), input);
  return read(pass.framebuffer(), geometry);
}

// The draw pass of projectors, one of which stands where the eye is.
Result<std::vector<Eigen::Vector4f>> draw_surface(const Scene& scene,
                                                  const btf::Material& material,
                                                  const btf::ModelShader& shader,
                                                  const calibration::ProjectorGeometry& geometry,
                                                  const DrawInput& input) {
  calibration::ProjectorProfile profile;
  profile.geometry = geometry;
  VENEER_ASSIGN(const DrawPass pass,
                DrawPass::create(shader,
                                 scene.lights,
                                 scene.texture_repeats,
                                 profile,
                                 {.filter = texel_filter(material, false)}));
  const GlTexture colour = make_texture_2d(GL_RGBA32F, geometry.width, geometry.height);
  const GlTexture depth = make_texture_2d(GL_DEPTH_COMPONENT32F, geometry.width, geometry.height);
  const GlFramebuffer framebuffer = make_framebuffer();
  glNamedFramebufferTexture(framebuffer.id(), GL_COLOR_ATTACHMENT0, colour.id(), 0);
  glNamedFramebufferTexture(framebuffer.id(), GL_DEPTH_ATTACHMENT, depth.id(), 0);
  if (glCheckNamedFramebufferStatus(framebuffer.id(), GL_FRAMEBUFFER) != GL_FRAMEBUFFER_COMPLETE)
    return fail(Errc::kUnavailable,
                "drawing from an eye: this GL cannot draw to {} x {} floats; ask for a smaller "
                "picture or fewer samples",
                geometry.width,
                geometry.height);
  pass.draw(framebuffer.id(), MeshBuffers(scene.mesh), input);
  std::vector<Eigen::Vector4f> pixels = read(framebuffer.id(), geometry);
  // A projector's geometric factor stands there; from an eye whatever was drawn hides, also what
  // faces away. Nothing was where depth is that of the farthest, 0.
  std::vector<float> depths(pixels.size());
  glReadPixels(0, 0, geometry.width, geometry.height, GL_DEPTH_COMPONENT, GL_FLOAT, depths.data());
  for (std::size_t i = 0; i < pixels.size(); ++i) pixels[i].w() = depths[i] > 0.0F ? 1.0F : 0.0F;
  return pixels;
}

}  // namespace

Status EyeView::check() const {
  if (!eye_in_world.cast<float>().allFinite())
    return fail(Errc::kInvalidOption, "drawing from an eye: the eye's place is no number");
  if (samples < 1 || samples > kMostSamples)
    return fail(Errc::kInvalidOption,
                "drawing from an eye: {} samples along a pixel's side; 1 to {} can be drawn",
                samples,
                kMostSamples);
  const int most = kMostPixels / samples;
  if (width < 1 || height < 1 || width > most || height > most)
    return fail(Errc::kInvalidOption,
                "drawing from an eye: a picture of {} x {} pixels; with {} samples along a pixel's "
                "side it may have 1 to {} along each of its own",
                width,
                height,
                samples,
                most);
  return {};
}

Result<calibration::ProjectorGeometry> geometry_of_eye(const Scene& scene,
                                                       const EyeView& view,
                                                       double beyond_m) {
  const Ball ball = ball_about(scene.mesh);
  const Vector3d centre = scene.world_from_object * ball.centre;
  const double radius = ball.radius + beyond_m;
  const double distance = (view.eye_in_world - centre).norm();
  // Not so near either that the near plane cuts it.
  if (!(distance > radius + kNearPlane))
    return fail(Errc::kInvalidOption,
                "drawing from an eye: it is {:.3f} m from the middle of the object, which reaches "
                "{:.3f} m from there; move the eye further away",
                distance,
                radius);
  calibration::ProjectorGeometry geometry;
  geometry.width = view.width;
  geometry.height = view.height;
  const double tangent = radius / std::sqrt(distance * distance - radius * radius);
  geometry.fx = geometry.fy = std::min(view.width, view.height) / (2 * kMargin * tangent);
  geometry.cx = view.width / 2.0;
  geometry.cy = view.height / 2.0;
  geometry.world_from_projector = look_at(view.eye_in_world, centre, Vector3d::UnitY());
  return geometry;
}

Result<EyePicture> draw_from_eye(const Scene& scene,
                                 const btf::Material& material,
                                 const EyeView& view) {
  VENEER_TRY(view.check());
  VENEER_TRY(check_drawable(scene));
  const btf::ModelShader shader = material.shader();
  if (view.shells && !shader.shells)
    return fail(Errc::kInvalidOption,
                "drawing shells: the material's model, {}, has no layers that could be drawn as "
                "shells; fit the model layered, or leave shells out",
                material.model());
  std::optional<TexelSize> texel;
  double beyond_m = 0;
  if (shader.shells) {
    VENEER_ASSIGN(
        texel,
        texel_size_on(scene.mesh, scene.texture_repeats, {material.width(), material.height()}));
    const auto [lowest, highest] = std::ranges::minmax(shader.shells->heights);
    beyond_m = std::max(0.0, highest * texel->mean_m);
    const double furthest_m = std::max(std::abs(lowest), std::abs(highest)) * texel->mean_m;
    if (view.shells && furthest_m > ball_about(scene.mesh).radius)
      return fail(Errc::kInvalidOption,
                  "drawing shells: the layers reach {:.3g} m from the surface, further than the "
                  "object from its middle; raise texture_repeats in the scene, so that texels are "
                  "smaller",
                  furthest_m);
  }
  EyeView fine = view;
  fine.width *= view.samples;
  fine.height *= view.samples;
  VENEER_ASSIGN(const calibration::ProjectorGeometry geometry,
                geometry_of_eye(scene, fine, beyond_m));
  VENEER_ASSIGN(const EglContext context, EglContext::create());
  const DrawInput input{view.eye_in_world, scene.world_from_object};
  auto drawn = view.shells ? draw_shells(scene, shader, geometry, texel->mean_m, input)
                           : draw_surface(scene, material, shader, geometry, input);
  if (!drawn) return tl::unexpected(std::move(drawn).error());
  EyePicture picture = mean_of(*drawn, view);
  if (view.shells) picture.texel = texel;
  return picture;
}

}  // namespace veneer::render
