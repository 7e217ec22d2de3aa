// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <span>
#include <string_view>

namespace veneer::cli {

// The figures of Meseth, Mueller, Sattler, Klein 2003, "BTF Rendering for Virtual Environments",
// and what it takes to repeat them.

inline constexpr int kPublishedLobes = 2;
inline constexpr int kPublishedClusters = 32;

/// What the number of values depends on.
struct SetSize {
  int texels = 0;
  int views = 0;
  int lights = 0;
};
/// That of the paper's sets.
inline constexpr SetSize kPublishedSize{256 * 256, 81, 81};

/// One column of the paper's tables.
struct PublishedModel {
  std::string_view label;       ///< the paper's
  std::string_view model;       ///< the registry's
  std::string_view components;  ///< empty where the model has none
  bool lobes;                   ///< a model of lobes, else a linear decomposition
  double values;                ///< a texel, Table 2
  double bytes;                 ///< a texel, Table 2
  int fetches;                  ///< "TEX" for one light and typical sizes, Table 3
  int alu;                      ///< the same of other operations
  std::string_view fps;         ///< on a GeForce FX 5900
  /// Values a texel of a set of this size, from the model's equation in section 3 of the paper; no
  /// more clusters than texels are counted. @pre  texels, views and lights > 0.
  double (*values_of)(const SetSize& size);
};
/// In the paper's order: LAF, SLAF, RF, PCA, LPCA.
[[nodiscard]] std::span<const PublishedModel, 5> published_models();
/// The column that was measured with this model of the registry at these components; null for
/// others.
[[nodiscard]] const PublishedModel* find_published_model(std::string_view model,
                                                         std::string_view components);

/// epsilon over the texels of a material, gamma-encoded.
struct PublishedErrors {
  double avg;
  double min;
  double max;
};
struct PublishedMaterial {
  std::string_view name;                  ///< as `veneer compare --material` takes it
  std::array<PublishedErrors, 5> errors;  ///< of published_models(), Table 1
};
[[nodiscard]] std::span<const PublishedMaterial> published_materials();
/// Null where the paper has no such material.
[[nodiscard]] const PublishedMaterial* find_published_material(std::string_view name);
/// The material whose name a set's name tells, such as "alu" or "Wallpaper64"; null where none.
[[nodiscard]] const PublishedMaterial* guess_published_material(std::string_view set_name);

}  // namespace veneer::cli
