// SPDX-License-Identifier: Apache-2.0
#include "cli/comparison/published.h"

#include <algorithm>
#include <cctype>
#include <string>

namespace veneer::cli {
namespace {

constexpr int kLobes = kPublishedLobes;
constexpr int kEigenTextures = 16;
constexpr int kEigenBrdfs = 8;

// Equation (2): diffuse and specular colour; three diagonal entries and an exponent for each lobe.
double lafortune_values(const SetSize&) { return 6.0 + 4.0 * kLobes; }

// Equation (4): the same, and a colour for each view.
double scaled_lafortune_values(const SetSize& size) {
  return lafortune_values(size) + 3.0 * size.views;
}

// Equation (5): a diffuse colour, and for each view a specular one and its lobes.
double reflectance_field_values(const SetSize& size) {
  return 3.0 + size.views * (3.0 + 4.0 * kLobes);
}

// Equation (6): for each view the texel's colour in every Eigen-texture. The weights of directions
// belong to the whole set and are not counted.
double eigen_texture_values(const SetSize& size) { return 3.0 * size.views * kEigenTextures; }

// Equation (7): the cluster, a weight for each Eigen-BRDF, and the texel's share of those.
double lpca_values(const SetSize& size) {
  const double clusters = std::min(kPublishedClusters, size.texels);
  return 1.0 + kEigenBrdfs + 3.0 * size.views * size.lights * kEigenBrdfs * clusters / size.texels;
}

constexpr std::array<PublishedModel, 5> kModels{{
    {"LAF", "lafortune", "", true, 14, 22, 4, 21, "100", &lafortune_values},
    {"SLAF", "scaled-lafortune", "", true, 257, 508, 9, 50, "50", &scaled_lafortune_values},
    {"RF", "reflectance-field", "", true, 894, 1785, 12, 79, "25", &reflectance_field_values},
    {"PCA", "eigen-texture", "16", false, 3888, 3888, 91, 160, "6", &eigen_texture_values},
    {"LPCA", "lpca", "8", false, 85.9, 170.8, 88, 56, "11", &lpca_values},
}};

constexpr std::array<PublishedMaterial, 6> kMaterials{{
    {"proposte",
     {{{.0999, .0655, .1180},
       {.0825, .0545, .1044},
       {.0745, .0494, .0934},
       {.0150, .0090, .0237},
       {.0293, .0160, .0648}}}},
    {"wool",
     {{{.0833, .0607, .1158},
       {.0736, .0568, .0967},
       {.0590, .0464, .0745},
       {.0164, .0097, .0237},
       {.0235, .0127, .0359}}}},
    {"wallpaper",
     {{{.0630, .0386, .1020},
       {.0593, .0378, .0928},
       {.0459, .0325, .0682},
       {.0158, .0089, .0315},
       {.0222, .0110, .0430}}}},
    {"stone",
     {{{.0954, .0392, .1892},
       {.0853, .0354, .1814},
       {.0642, .0287, .1264},
       {.0166, .0086, .0434},
       {.0197, .0099, .0410}}}},
    {"aluminium",
     {{{.0572, .0391, .0935},
       {.0558, .0389, .0889},
       {.0479, .0324, .0782},
       {.0142, .0065, .0236},
       {.0109, .0062, .0176}}}},
    {"leather",
     {{{.0499, .0391, .0658},
       {.0489, .0388, .0641},
       {.0392, .0310, .0529},
       {.0163, .0100, .0247},
       {.0172, .0092, .0270}}}},
}};

}  // namespace

std::span<const PublishedModel, 5> published_models() { return kModels; }

const PublishedModel* find_published_model(std::string_view model, std::string_view components) {
  const auto* found = std::ranges::find_if(kModels, [&](const PublishedModel& published) {
    return published.model == model && published.components == components;
  });
  return found == kModels.end() ? nullptr : found;
}

std::span<const PublishedMaterial> published_materials() { return kMaterials; }

const PublishedMaterial* find_published_material(std::string_view name) {
  const auto* found = std::ranges::find(kMaterials, name, &PublishedMaterial::name);
  return found == kMaterials.end() ? nullptr : found;
}

const PublishedMaterial* guess_published_material(std::string_view set_name) {
  std::string lower(set_name);
  std::ranges::transform(lower, lower.begin(), [](unsigned char c) { return std::tolower(c); });
  if (lower.starts_with("alu")) return find_published_material("aluminium");  // as Bonn names it
  const auto* found = std::ranges::find_if(kMaterials, [&lower](const PublishedMaterial& material) {
    return lower.find(material.name) != std::string::npos;
  });
  return found == kMaterials.end() ? nullptr : found;
}

}  // namespace veneer::cli
