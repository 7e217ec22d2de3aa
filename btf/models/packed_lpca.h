// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <functional>
#include <string>

#include "btf/models/angular_grid.h"
#include "btf/models/cluster_volume.h"
#include "btf/models/fitted_pairs.h"
#include "btf/models/half_angle.h"
#include "btf/models/lpca_factors.h"
#include "btf/texel_pyramid.h"

namespace veneer::btf {

/// Two scalar functions of (view, light) for every texel, clustered together, each a weighted sum
/// of scalar Eigen-BRDFs that are packed four to an RGBA volume and drawn with hardware
/// interpolation in three of the four directions' coordinates: two fetches for four components.
/// What models of two terms (scalar times colour) have in common. Immutable and thread-safe.
///
/// The second function may be one of the half angle instead (half_angle.h), in volumes of its own:
/// one fetch for four components, and a fortieth of the bytes. And it may have clusters of its own,
/// as many, which are then fetched apart. Or it may be left out, which makes it 0.
///
/// Sources: Schneider 2004, "Real-time BTF Rendering", section 6.2 (two fetches, the fourth
/// coordinate mixed by hand); Mueller et al. 2003 (clusters).
class PackedLpca {
 public:
  /// Eigen-BRDFs in one volume, a channel each.
  static constexpr int kScalarsPerVolume = 4;
  /// Components of the first and the second function.
  using Components = std::array<int, 2>;
  /// Reads the functions of one texel of the pyramid at every pair of the frame, [view][light];
  /// thread-safe.
  using Read = std::function<void(int texel, std::span<float> first, std::span<float> second)>;
  /// What lights beyond the data do: kLight fades with the cosine, kView stays as at the border.
  struct Layout {
    Components components{};
    int angular = 16;
    DirectionBoxes boxes = {};
    DirectionRole beyond = DirectionRole::kLight;
    int colours = 1;  ///< of a texel, 1 or 2
    int mip_levels = 1;
    bool separate = false;    ///< each function has clusters of its own
    bool half_angle = false;  ///< of the second function; fit() leaves that to with_half_angle()
  };

  /// Refuses, with `code`, volumes and textures larger than GPUs take. fit() and load() ask it too;
  /// models that look at all samples first ask it before.
  [[nodiscard]] static Status check(const MaterialFrame& frame,
                                    const Layout& layout,
                                    int clusters,
                                    Errc code,
                                    std::string_view doing);
  /// Reads at the pairs of `pairs`, whose frame it has, with the boxes of `layout`. Errors:
  /// kInvalidOption, of check().
  [[nodiscard]] static Result<PackedLpca> fit(const FittedPairs& pairs,
                                              const FitOptions& options,
                                              const Layout& layout,
                                              const Read& read,
                                              Progress& progress);
  /// Reads what add_to() wrote, within the limits of fit(). Errors: kBadFormat, also where the file
  /// has mip levels and the model has not.
  /// @param layout  components, angular, boxes and mip_levels are the file's, whatever it says of
  /// them.
  [[nodiscard]] static Result<PackedLpca> load(const SafetensorsFile& file,
                                               Layout layout,
                                               bool with_mip_levels = false);
  void add_to(Material::Contents& contents) const;

  [[nodiscard]] const MaterialFrame& frame() const { return frame_; }
  /// The texels, with those of the mip levels, that functions below and colours are of. All levels
  /// share their clusters.
  [[nodiscard]] TexelPyramid pyramid() const { return pyramid_of(frame_, layout_); }
  [[nodiscard]] bool has_separate_clusters() const { return layout_.separate; }
  [[nodiscard]] bool has_half_angle() const { return layout_.half_angle; }
  [[nodiscard]] const Components& components() const { return layout_.components; }
  /// The same with the nearest second function of the half angle: its Eigen-BRDFs are taken there,
  /// and its weights found anew.
  /// @param read, pairs, ranks  as fit() had them.
  [[nodiscard]] PackedLpca with_half_angle(const Read& read,
                                           const FittedPairs& pairs,
                                           Communicator& ranks) const;
  /// How far each function of texels of the sample evenly chosen is from what `read` gives, as
  /// drawn at the measured pairs, these weighted: root mean square.
  [[nodiscard]] Eigen::Vector2d rmse(const Read& read, const FittedPairs& pairs) const;
  /// As Material::values_per_texel(). A texel of the sample counts for its share of mip levels.
  [[nodiscard]] double values_per_texel() const;
  /// Both functions of a texel at every measured pair, from the factors.
  void reconstruct(int texel, std::span<float> first, std::span<float> second) const;
  /// Both functions as drawn, from the float16 volumes in double precision. The horizon is the
  /// caller's.
  [[nodiscard]] Eigen::Vector2d evaluate(int texel,
                                         const Direction& view,
                                         const Direction& light) const;

  /// @param colours  of texels, three for each colour: [texel][colour][3].
  /// @return GLSL constants and the function
  /// `void packed_evaluate(vec2 uv, vec3 view, vec3 light, out vec2 scalars, out vec3
  /// colours[count])`, its textures and fetches; with CACHE_PIXELS also `packed_cached(uv, scalars,
  /// colours)` (EigenCache).
  [[nodiscard]] ModelShader shader(std::span<const Eigen::half> colours) const;

 private:
  // @param second_cluster  [texel] where they are separate
  PackedLpca(MaterialFrame frame,
             Layout layout,
             LpcaFactors factors,
             std::vector<std::uint8_t> second_cluster);
  [[nodiscard]] static TexelPyramid pyramid_of(const MaterialFrame& frame, const Layout& layout);
  // Where a component stands: which volume, and which of its four channels.
  struct Slot {
    std::size_t volume;
    std::size_t channel;
  };
  [[nodiscard]] Slot slot(int component) const;
  // Whether the second function has volumes of its own, behind those of the first.
  [[nodiscard]] bool is_split() const { return layout_.separate || layout_.half_angle; }
  [[nodiscard]] int first_volumes() const;
  [[nodiscard]] int volume_count() const;
  // Of the first function and of the second.
  [[nodiscard]] std::array<int, 2> clusters_of(int texel) const;
  [[nodiscard]] ModelTexture pack_texels(std::span<const Eigen::half> colours) const;
  [[nodiscard]] ModelTexture volume_texture(int volume) const;
  void fill_volumes();
  void fill_half_angles();
  [[nodiscard]] RowMatrix second_brdfs() const;

  MaterialFrame frame_;
  Layout layout_;
  LpcaFactors factors_;
  std::vector<std::uint8_t> second_cluster_;  // [texel], empty where both functions share
  AngularGrid views_;
  AngularGrid lights_;
  ClusterVolume place_;
  half_angle::Volume half_place_;
  std::vector<std::vector<Eigen::half>> volumes_;  // [volume][texel][4]
};

}  // namespace veneer::btf
