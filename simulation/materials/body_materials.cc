// SPDX-License-Identifier: Apache-2.0
#include "simulation/materials/body_materials.h"

#include <algorithm>

#include "simulation/materials/internal_materials.h"

namespace veneer::simulation {

namespace {

constexpr std::array kMaterials{
    BodyMaterial{
        "bars", "painted bars that hover crosswise over a ground", &make_bars, kBarHeights},
    BodyMaterial{
        "lichen", "drooping leaves of lichen on stalks over rock", &make_lichen, kLichenHeights},
};
static_assert(std::ranges::is_sorted(kMaterials, {}, &BodyMaterial::name));

}  // namespace

std::span<const BodyMaterial> body_materials() { return kMaterials; }

const BodyMaterial* find_body_material(std::string_view name) {
  const auto* const found = std::ranges::find(kMaterials, name, &BodyMaterial::name);
  return found == kMaterials.end() ? nullptr : found;
}

}  // namespace veneer::simulation
