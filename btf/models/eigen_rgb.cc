// SPDX-License-Identifier: Apache-2.0
#include "btf/models/eigen_rgb.h"

#include <fmt/format.h>

#include <string_view>

namespace veneer::btf {
namespace {

constexpr std::string_view kNames = "xyzw";

char name_of(int scalar) { return kNames[static_cast<std::size_t>(scalar % 4)]; }

}  // namespace

std::string eigen_rgb(int component) {
  const int first = 3 * component;
  return fmt::format("vec3(eigen[{}].{}, eigen[{}].{}, eigen[{}].{})",
                     first / 4,
                     name_of(first),
                     (first + 1) / 4,
                     name_of(first + 1),
                     (first + 2) / 4,
                     name_of(first + 2));
}

std::string fill_eigen_rgb(int components) {
  std::string text;
  for (int layer = 0; layer < eigen_rgb_layers(components); ++layer) {
    text += fmt::format("  values[{}] = vec4(", layer);
    for (int scalar = 4 * layer; scalar < 4 * layer + 4; ++scalar) {
      const bool used = scalar < 3 * components;
      text +=
          used ? fmt::format("brdf{}.{}", scalar / 3, kNames[static_cast<std::size_t>(scalar % 3)])
               : "0.0";
      text += scalar % 4 == 3 ? ");\n" : ", ";
    }
  }
  return text;
}

std::string fetch_eigen_rgb(int components) {
  std::string text = fmt::format("  vec4 eigen[{}];\n", eigen_rgb_layers(components));
  for (int layer = 0; layer < eigen_rgb_layers(components); ++layer)
    text += fmt::format("  eigen[{0}] = cached_eigen(cluster, {0});\n", layer);
  return text;
}

}  // namespace veneer::btf
