// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "base/random.h"
#include "base/result.h"
#include "btf/material.h"
#include "btf/models/layered/layer_stack.h"
#include "btf/sample_set.h"
#include "btf/texel_map.h"

// What the tests of models' shaders draw.
namespace veneer::render {

/// Along a side of every sample here.
inline constexpr int kTexels = 8;
inline constexpr int kMipLevels = 3;
inline constexpr const char* kWithMipLevels = "texel-colours with mip levels";

/// A set whose body colour and gloss differ from texel to texel: Lambert, and a lobe about the
/// mirror direction.
[[nodiscard]] Result<btf::SampleSet> make_samples(const std::filesystem::path& folder);

/// So that a fit takes no time.
[[nodiscard]] btf::FitOptions quick_options(const char* components);

/// A stack with random heights and points: opaque, clear and between, with normals that turn away
/// from lights and views.
[[nodiscard]] btf::LayerStack random_stack(int layers, Pcg32& random);

/// Of `side` x `side` places, each of which shows any texel of the sample.
[[nodiscard]] btf::TexelMap random_map(int side, std::uint64_t seed);

struct Fitted {
  std::string name;
  std::unique_ptr<btf::Material> material;
};

/// Every model of the registry in every form that it knows, alone and with a texel map, for all
/// directions and for parts of them; and stacks of layers of every number. Fitted at the first
/// call.
[[nodiscard]] const std::vector<Fitted>& fitted();

}  // namespace veneer::render
