// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <vector>

#include "btf/fit_region.h"
#include "btf/material.h"

namespace veneer::btf {

/// What every material knows of the set it was fitted on.
struct MaterialFrame {
  int width = 0;   ///< texels
  int height = 0;  ///< texels
  DirectionSet views;
  DirectionSet lights;

  [[nodiscard]] int texel_count() const { return width * height; }
  [[nodiscard]] int pair_count() const { return static_cast<int>(views.size() * lights.size()); }
};
[[nodiscard]] MaterialFrame frame_of(const SampleSetInfo& info);

/// Adds the frame to a material's contents: metadata "width", "height", tensors "views", "lights".
void add_frame(const MaterialFrame& frame, Material::Contents& contents);
/// Reads it back. Errors: kBadFormat (missing, sizes out of range, directions that no sample set
/// may have).
[[nodiscard]] Result<MaterialFrame> read_frame(const SafetensorsFile& file);

/// Where a material's grids of views and of lights lie.
struct DirectionBoxes {
  DirectionBox views;
  DirectionBox lights;
};
/// Adds the tensor "boxes" where one of them is not all; borrows them.
void add_boxes(const DirectionBoxes& boxes, Material::Contents& contents);
/// Reads them back: all where the file has none, as older ones. Errors: kBadFormat.
[[nodiscard]] Result<DirectionBoxes> read_boxes(const SafetensorsFile& file);

/// Texels of a texture's side that every GL 4.5 takes.
inline constexpr int kMostTextureSide = 16384;
/// Refuses, with `code`, a texture that a GPU might refuse.
[[nodiscard]] Status check_texture(std::string_view what,
                                   std::int64_t width,
                                   std::int64_t height,
                                   Errc code,
                                   std::string_view doing);

/// A metadata entry that is an integer in [least, most]. Errors: kBadFormat.
[[nodiscard]] Result<int> read_integer(const SafetensorsFile& file,
                                       const std::string& key,
                                       int least,
                                       int most);
/// A float16 tensor with finite elements. Errors: kBadFormat.
[[nodiscard]] Result<std::vector<Eigen::half>> read_halves(const SafetensorsFile& file,
                                                           const std::string& name,
                                                           const std::vector<std::int64_t>& shape);
/// A tensor with the cluster of every texel, each < clusters. Errors: kBadFormat.
[[nodiscard]] Result<std::vector<std::uint8_t>> read_clusters(const SafetensorsFile& file,
                                                              const std::string& name,
                                                              int texels,
                                                              int clusters);

/// A tensor that borrows `values`.
template <class T>
[[nodiscard]] Material::Contents::Tensor tensor_of(std::string name,
                                                   std::vector<std::int64_t> shape,
                                                   const std::vector<T>& values) {
  return {{std::move(name), DTypeOf<T>::kValue, std::move(shape)},
          std::as_bytes(std::span(values))};
}

/// Float16 of a value; beyond its range the largest that there is.
[[nodiscard]] Eigen::half saturated_half(float value);

}  // namespace veneer::btf
