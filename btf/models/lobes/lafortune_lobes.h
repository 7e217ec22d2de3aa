// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string>
#include <vector>

#include "base/progress.h"
#include "btf/material.h"
#include "btf/models/fitted_pairs.h"
#include "btf/models/lobes/lobe_fit.h"
#include "btf/models/material_tensors.h"

namespace veneer::btf {

/// Layers of an array texture that every GL 4.5 takes.
inline constexpr int kMostTextureLayers = 2048;
/// check_texture(), and the layers of an array.
[[nodiscard]] Status check_array(std::string_view what,
                                 const MaterialFrame& frame,
                                 std::int64_t layers,
                                 Errc code,
                                 std::string_view doing);

/// A colour of each texel, [texel][3], or of each texel and view. Errors: kBadFormat (also where
/// one is negative).
[[nodiscard]] Result<std::vector<Eigen::half>> read_colours(const SafetensorsFile& file,
                                                            const std::string& name,
                                                            const std::vector<std::int64_t>& shape);
/// Lobes, the last of `shape` being kLobeValues. Errors: kBadFormat (also exponents out of range).
[[nodiscard]] Result<std::vector<Eigen::half>> read_lobes(const SafetensorsFile& file,
                                                          const std::vector<std::int64_t>& shape);

/// Three stored numbers as a colour.
[[nodiscard]] Eigen::Vector3d colour_at(std::span<const Eigen::half> values, std::size_t index);

/// The layers of an RGBA array texture, filled a texel at a time.
class LayerWriter {
 public:
  LayerWriter(int texels, int layers);
  /// @param values  1 to 4; what is missing is 0.
  void put(int layer, int texel, std::span<const Eigen::half> values);
  [[nodiscard]] ModelTexture texture(std::string sampler, const MaterialFrame& frame) const;

 private:
  std::size_t texels_;
  int layers_;
  std::vector<Eigen::half> values_;
};

/// Every (view, light) of a set, view by view.
[[nodiscard]] LobeSamples pair_samples(const MaterialFrame& frame);
/// Every light, for one view.
[[nodiscard]] LobeSamples light_samples(const MaterialFrame& frame);

/// RGB of samples as targets of a fit, each weighted by (its mean + kWeightFloor)^-kWeightPower:
/// near to what a difference is worth after encoding, which is what the tables of the literature
/// count. @param rgb  [sample][3] @param importance  what squared errors of each sample are
/// weighted by beside that; empty: all alike.
[[nodiscard]] LobeTargets weighted_targets(std::span<const float> rgb,
                                           std::span<const float> importance = {});

/// What a fit says at its end where texels fell back.
[[nodiscard]] std::string fallback_remark(int texels);

/// A texel's lobes of LobeSpace::kPair.
struct TexelFit {
  StoredLobes stored;
  bool fell_back;  ///< the lobes gained nothing over the diffuse colour, which stays alone
};
[[nodiscard]] TexelFit fit_texel(const LobeFitter& fitter, const LobeTargets& targets);

/// Spatially varying Lafortune lobes: the diffuse and the specular colour of each texel and its k
/// lobes with diagonal matrices.
struct LafortuneLobes {
  int lobes;
  int fallback_texels = 0;            ///< whose lobes gained nothing over their diffuse colour
  std::vector<Eigen::half> diffuse;   ///< [texel][3]
  std::vector<Eigen::half> specular;  ///< [texel][3]
  std::vector<Eigen::half> shapes;    ///< [texel][lobe][kLobeValues]

  /// All black.
  LafortuneLobes(int texels, int lobes);
  [[nodiscard]] static LafortuneLobes fit(const SampleSet& set,
                                          const FittedPairs& pairs,
                                          int lobes,
                                          Progress& progress);
  void set_texel(int texel, const StoredLobes& stored);
  /// Errors: kBadFormat.
  [[nodiscard]] static Result<LafortuneLobes> read(const SafetensorsFile& file,
                                                   const MaterialFrame& frame);
  void add_to(int texels, Material::Contents& contents) const;
  /// light.z (diffuse + specular sum of lobes). @param light  above the horizon. @param view  too.
  /// With light.z outside of all, before the diffuse colour only, and nowhere, 64 x 64 texels of
  /// the Bonn wallpaper keep an encoded epsilon of .0350, .0362, .0686, the aluminium .0440, .0507,
  /// .0549.
  [[nodiscard]] Eigen::Vector3d evaluate(int texel,
                                         const Direction& view,
                                         const Direction& light) const;
  /// The same without its lobes.
  [[nodiscard]] Eigen::Vector3d evaluate_diffuse(int texel, const Direction& light) const;
  /// Layers: the diffuse colour, the specular one, a lobe each.
  [[nodiscard]] int layers() const { return 2 + lobes; }
  [[nodiscard]] ModelTexture texture(const MaterialFrame& frame) const;
  [[nodiscard]] double values_per_texel() const { return 6 + kLobeValues * lobes; }
};

}  // namespace veneer::btf
