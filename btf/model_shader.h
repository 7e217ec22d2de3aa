// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace veneer::btf {

/// How a texture that a model's shader reads is laid out; the names are OpenGL's.
enum class TextureKind { k2D, k2DArray, k3D };
enum class TexelFormat {
  kR8ui,
  kR16ui,
  kRg16ui,
  kRgba16ui,
  kRgba32ui,
  kRgba8,
  kRgba8Snorm,
  kR16f,
  kRg16f,
  kRgba16f,
  kRgba32f
};
[[nodiscard]] std::size_t bytes_per_texel(TexelFormat format);

struct ModelTexture {
  std::string sampler;  ///< the uniform's name in the shader
  TextureKind kind = TextureKind::k2D;
  TexelFormat format = TexelFormat::kRgba16f;
  int width = 1;
  int height = 1;
  int depth = 1;  ///< layers of an array, slices of a volume
  bool linear =
      false;  ///< filtered between texels (never for integer formats); clamped to the edge
  std::vector<std::byte> data = {};  ///< x fastest, then y, then depth
};

/// The bytes of a texture's values.
template <class T>
[[nodiscard]] std::vector<std::byte> texture_data(const std::vector<T>& values) {
  const auto bytes = std::as_bytes(std::span(values));
  return {bytes.begin(), bytes.end()};
}

/// A model whose texels mix values that depend on the directions alone and are few: one set for
/// each cluster. The renderer may then evaluate these at the nodes of a coarse grid over the
/// picture and interpolate between them, which leaves a pixel its texel's weights and `layers`
/// filtered fetches for each light (Sattler et al. 2003, section 5, evaluate so per triangle; here
/// for clusters).
///
/// Where CACHE_NODES or CACHE_PIXELS is defined, `const int kCacheLayers` stands before the source.
/// With CACHE_NODES the source also defines a type EigenPlace, `EigenPlace eigen_place(vec3
/// view, vec3 light)` and `void eigen_values(EigenPlace place, int cluster, out vec4
/// values[layers])`, 0 for lights at and below the horizon. With CACHE_PIXELS it defines
/// `vec3 btf_radiance_cached(vec2 uv)`, which gets the interpolated values from the renderer's
/// `vec4 cached_eigen(int cluster, int layer)`.
struct EigenCache {
  int clusters = 0;
  int layers = 0;         ///< of four values, for each cluster
  int texel_fetches = 0;  ///< of one call of btf_radiance_cached(), without the layers'
};

/// A model whose texels lie in layers, which may also be drawn as shells around a mesh, one for
/// each layer, so that the contour of the texture shows. The source then also defines `vec4
/// btf_shell(int layer, vec2 uv, vec3 view, vec3 light)`: the radiance of the layer's texel at uv,
/// without what lies above it, and in alpha how much it hides of what lies below, 0 to 1.
struct ShellLayers {
  std::vector<float> heights;  ///< above the surface, in texels, from the top
};

/// What the renderer needs to draw a material: GLSL that defines
/// `vec3 btf_radiance(vec2 uv, vec3 view, vec3 light)` in the sample's unit, and its textures.
/// `uv` is in repeats of the material (uv.x = 1 is one width() to the right), `view` and `light`
/// are unit vectors in the local frame; view.z may be slightly below 0 at silhouettes. Of a
/// material with mip levels (Material::mip_levels) the source declares `int texel_level`, the level
/// that is read, which is 0 until it is set.
///
/// Who draws may define SPECULAR_WEIGHT before the source, an expression in 0 to 1. A model whose
/// specular part is a term of its own (Material::has_specular_term()) multiplies it by that, in
/// btf_radiance() and btf_radiance_cached(), and puts models/specular_weight.glsl first, which
/// makes it 1 where nobody says. Other models do not read it.
struct ModelShader {
  std::string source;  ///< constants first, no #version
  std::vector<ModelTexture> textures;
  int fetches = 0;  ///< texture fetches for one call
  /// Of one call: how many texels the model asks for, each of which a texel map (mapped_material.h)
  /// has to be read for.
  int texels_read = 1;
  std::optional<EigenCache> cache = std::nullopt;    ///< for models that offer it
  std::optional<ShellLayers> shells = std::nullopt;  ///< for models that offer it
  [[nodiscard]] std::size_t gpu_bytes() const;
};

}  // namespace veneer::btf
