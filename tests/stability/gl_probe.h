// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "base/result.h"
#include "tests/stability/subjects.h"

namespace veneer::stability {

/// A material's shader on the GPU.
class GlProbe {
 public:
  /// Links the shader in the program's one context. Errors: kUnavailable where there is no GL, the
  /// compiler's words where it refuses the shader.
  [[nodiscard]] static Result<GlProbe> create(const btf::Material& material);
  GlProbe(GlProbe&&) noexcept;
  ~GlProbe();
  /// btf_radiance() of all in one draw, at the centres of level 0's texels. Not trapped.
  [[nodiscard]] std::vector<Eigen::Vector3d> draw(std::span<const Query> queries) const;

 private:
  struct State;
  explicit GlProbe(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

/// As the GPU gets it: rounding the directions themselves is then no difference.
[[nodiscard]] std::vector<Query> rounded_to_float(std::vector<Query> queries);

}  // namespace veneer::stability
