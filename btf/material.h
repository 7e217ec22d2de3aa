// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "base/progress.h"
#include "base/result.h"
#include "base/safetensors.h"
#include "btf/communicator.h"
#include "btf/direction.h"
#include "btf/model_shader.h"
#include "btf/sample_set.h"

namespace veneer::btf {

struct FitRegion;
class TexelMap;

/// Heights above the reference plane of a sample set, in texels. lowest < highest, unless there is
/// one layer only.
struct HeightRange {
  double lowest = 0.0;
  double highest = 0.0;
};

/// How to fit a model; each model reads what it knows and refuses what it cannot do.
struct FitOptions {
  /// Clusters of texels. 1 to 256.
  int clusters = 32;
  /// Eigen-BRDFs stored and fetched per texel: "4", or "3+1" for models of two scalar terms.
  std::string components = "4";
  /// Which way a model puts its terms together, where it offers several; empty takes its own
  /// choice. dichromatic-lpca: "learned" (default), "ratio" or "subtractive".
  std::string form;
  /// Nodes along each side of the square that directions are mapped to, for models drawn through
  /// Schneider's elevated concentric map. 4 to 32: the volume grows with the fourth power.
  int angular = 16;
  static constexpr int kLeastAngular = 4;
  static constexpr int kMostAngular = 32;
  /// Lobes of a texel, for models made of them. 1 to 4.
  int lobes = 2;
  static constexpr int kMostLobes = 4;
  /// Layers of `layered`, up to LayerStack::kMostLayers; 0: as many as the data support.
  int layers = 0;
  /// Where its lowest and its highest layer lie, texels above the reference plane; empty: found
  /// from the data.
  std::optional<HeightRange> heights;
  /// How the GPU keeps what dominates a model's size, where it offers several: "8bit" or
  /// "float16"; empty takes the model's own choice (revised-lpca, eigen-texture: 8bit).
  std::string precision;
  /// How dichromatic-lpca keeps its specular term: "product" (empty takes it) over view and light,
  /// "half-angle" over the isotropic angles of Rusinkiewicz, or "measured", whichever serves.
  std::string specular;
  /// Whether dichromatic-lpca finds the clusters of its two terms together: "joint" (empty takes
  /// it), "separate", or "measured", whichever serves.
  std::string clustering;
  /// The sample and what it shows from further away: each level halves the texels along a side. 1
  /// is the sample alone; up to as many as halving leaves a texel along both sides (texel-colours).
  int mip_levels = 1;
  /// Columns of the randomised basis in which clusters are found; 0 fits in the full space.
  int basis = 160;
  /// Lloyd iterations at most, from each start and after each swap of clusters.
  int iterations = 60;
  std::uint64_t seed = 1;
  /// What a scene can ask of the material; null: anything. Models that cannot use it fit it all.
  /// Borrowed for the call.
  const FitRegion* region = nullptr;
  /// Who fits: every rank calls fit() with the same set and options, and all get the whole
  /// material. More than one only where Model::over_ranks. Borrowed for the call.
  Communicator* ranks = &alone();
  /// Errors: kInvalidOption, naming the option and what it may be.
  [[nodiscard]] Status check() const;
};

/// A fitted material. Immutable and thread-safe.
class Material {
 public:
  virtual ~Material() = default;
  /// The model's name in the registry.
  [[nodiscard]] virtual std::string_view model() const = 0;
  [[nodiscard]] virtual int width() const = 0;   ///< texels
  [[nodiscard]] virtual int height() const = 0;  ///< texels
  [[nodiscard]] virtual const DirectionSet& views() const = 0;
  [[nodiscard]] virtual const DirectionSet& lights() const = 0;
  /// With more than one, texels below may also be of a mip level, numbered as in TexelPyramid.
  [[nodiscard]] virtual int mip_levels() const { return 1; }
  /// What the factors alone give for one texel at every measured pair: [view][light][3], linear
  /// RGB, not clamped. This is what the tables of the literature measure.
  virtual void reconstruct(int texel, std::span<float> rgb) const = 0;
  /// What the shader draws, in double precision and from the numbers that the GPU is given:
  /// direction interpolation included, negative results cut to 0.
  [[nodiscard]] virtual Eigen::Vector3d radiance(int texel,
                                                 const Direction& view,
                                                 const Direction& light) const = 0;
  /// Whether the model draws a specular term of its own, which SPECULAR_WEIGHT multiplies in its
  /// shader (model_shader.h). Models of the whole reflectance have none to take away.
  [[nodiscard]] virtual bool has_specular_term() const { return false; }
  /// What is left of radiance() without that term, negative results cut to 0; all of it where there
  /// is none. Between them the shader is linear in the weight, before the cut.
  [[nodiscard]] virtual Eigen::Vector3d diffuse_radiance(int texel,
                                                         const Direction& view,
                                                         const Direction& light) const {
    return radiance(texel, view, light);
  }
  /// Where the material is larger than its sample, which texel of it each place shows
  /// (mapped_material.h); null: it is the sample itself.
  [[nodiscard]] virtual const TexelMap* texel_map() const { return nullptr; }
  /// radiance() and reconstruct() of a place of a map over this material. Models that look at more
  /// than one texel find the others by moving on the map.
  [[nodiscard]] virtual Eigen::Vector3d radiance_on(const TexelMap& map,
                                                    int place,
                                                    const Direction& view,
                                                    const Direction& light) const;
  virtual void reconstruct_on(const TexelMap& map, int place, std::span<float> rgb) const;
  [[nodiscard]] virtual ModelShader shader() const = 0;
  /// Numbers kept for one texel, whatever their precision, with a texel's share of what clusters
  /// have in common; what a whole set shares is not counted (Meseth et al. 2003, Table 2).
  [[nodiscard]] virtual double values_per_texel() const = 0;
  /// The factors and metadata that load() of the model reads back. The registry adds "format",
  /// "version" and "model".
  struct Contents {
    struct Tensor {
      TensorSpec spec;
      std::span<const std::byte> bytes;  ///< borrowed from the material
    };
    std::vector<Tensor> tensors;
    std::map<std::string, std::string> metadata;
  };
  [[nodiscard]] virtual Contents contents() const = 0;
};

/// One line of the registry.
struct Model {
  std::string_view name;
  std::string_view summary;  ///< one line, with author and year
  /// How many numbers FitOptions::components has: 1 ("4"), 2 ("3+1"), or 0 where the model has no
  /// components and does not read it.
  int terms;
  bool polarised;  ///< fits only sets that know specular and diffuse apart
  /// Errors: kInvalidOption (options the model cannot do with this set), kBadFormat (samples).
  Result<std::unique_ptr<Material>> (*fit)(const SampleSet& set,
                                           const FitOptions& options,
                                           Progress& progress);
  Result<std::unique_ptr<Material>> (*load)(const SafetensorsFile& file);
  bool over_ranks = false;  ///< fit() shares the work among FitOptions::ranks
};

/// Every model, sorted by name.
[[nodiscard]] std::span<const Model> models();
/// Errors: kInvalidOption, naming the models there are.
[[nodiscard]] Result<const Model*> find_model(std::string_view name);

/// Writes a material whole or not at all. `provenance`, such as
/// what it was fitted on and how, goes into its metadata beside the material's own entries.
[[nodiscard]] Status save_material(const Material& material,
                                   const std::filesystem::path& path,
                                   const std::map<std::string, std::string>& provenance);
/// Errors: kNotFound, kBadFormat (no Veneer material, newer version, unknown model, damaged).
[[nodiscard]] Result<std::unique_ptr<Material>> load_material(const std::filesystem::path& path);

}  // namespace veneer::btf
