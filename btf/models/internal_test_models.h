// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "btf/internal_test_sets.h"
#include "btf/material.h"

// What the tests of all models share: a small set of known rank, and how to fit to it.
namespace veneer::btf::testing {

// Factors, weights and colours are float16: 2^-11 each, for values up to 1.
inline constexpr double kHalfTolerance = 4e-3;

inline SampleSetInfo small_info(bool polarised = false) {
  SampleSetInfo info;
  info.width = 5;  // an odd number of texels, which no tensor may be upset by
  info.height = 3;
  info.polarised = polarised;
  info.views = ring(6, 1.0);
  info.lights = ring(7, 1.1);
  info.source = "a formula";
  return info;
}

inline double cosine(const SampleSetInfo& info, int light) {
  return info.lights[static_cast<std::size_t>(light)].z();
}
inline double shine(const SampleSetInfo& info, int view, int light) {
  const Direction half =
      (info.views[static_cast<std::size_t>(view)] + info.lights[static_cast<std::size_t>(light)])
          .normalized();
  return std::pow(half.z(), 12.0) * cosine(info, light);
}

// Body colour times cosine plus light colour times a lobe: rank 1 in each term, two colours a
// texel. Polarised sets have the two parts in separate channels.
inline float dichromatic(const SampleSetInfo& info, int texel, int view, int light, int channel) {
  constexpr std::array kLightColour{0.9, 0.8, 0.6};
  const bool diffuse_part = channel >= 3;
  const int c = channel % 3;
  const double diffuse = (0.1 + 0.05 * texel * (c + 1) / 3.0) * cosine(info, light);
  const double specular = 0.3 * (1 + texel % 3) / 3.0 * kLightColour[static_cast<std::size_t>(c)] *
                          shine(info, view, light);
  if (!info.polarised) return static_cast<float>(diffuse + specular);
  return static_cast<float>(diffuse_part ? diffuse : specular);
}

inline SampleSet dichromatic_set(const std::filesystem::path& folder, bool polarised) {
  const SampleSetInfo info = small_info(polarised);
  return make_set(folder, info, [info](int texel, int view, int light, int channel) {
    return dichromatic(info, texel, view, light, channel);
  });
}

inline Result<std::unique_ptr<Material>> fit(std::string_view model,
                                             const SampleSet& set,
                                             const FitOptions& options) {
  SilentProgress progress;
  return (*find_model(model))->fit(set, options, progress);
}

inline FitOptions options_with(std::string components, int clusters = 2) {
  FitOptions options;
  options.components = std::move(components);
  options.clusters = clusters;
  options.angular = 12;
  return options;
}

// The one that a model of one term takes, or of two.
inline std::string components_of(const Model& model, const char* one, const char* two) {
  return model.terms == 2 ? two : one;
}

inline double largest_error(const SampleSet& set, const Material& material) {
  std::vector<float> wanted(static_cast<std::size_t>(set.info().pair_count()) * 3);
  std::vector<float> got(wanted.size());
  double largest = 0.0;
  for (int texel = 0; texel < set.info().texel_count(); ++texel) {
    set.rgb(texel, Part::kTotal, wanted);
    material.reconstruct(texel, got);
    for (std::size_t i = 0; i < wanted.size(); ++i)
      largest = std::max(largest, double(std::abs(wanted[i] - got[i])));
  }
  return largest;
}

}  // namespace veneer::btf::testing
