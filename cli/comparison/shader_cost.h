// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

#include "base/result.h"

namespace veneer::cli {

/// What one call of a model's btf_radiance() executes, whatever the GPU.
struct ShaderCost {
  /// Arithmetic, comparisons, conversions, selections and built-in functions, a vector's as one, a
  /// fused multiply-add too; moves, fetches and branches are not counted. Both sides of a branch
  /// are.
  int arithmetic = 0;
  int fetches = 0;          ///< texture fetches, filtered or not
  bool loops_left = false;  ///< some loop could not be written out: the figures are too small
};

/// Counts the instructions of a SPIR-V module as spirv-dis prints it. What a function contains is
/// counted once, so inline them first.
[[nodiscard]] ShaderCost count_instructions(std::string_view disassembly);

/// Compiles the shader of a model (ModelShader::source) to SPIR-V, with functions inlined and loops
/// written out, and counts.
/// Errors: kUnavailable (glslangValidator, spirv-opt or spirv-dis is not there), kBadFormat (it
/// does not compile), kIo.
[[nodiscard]] Result<ShaderCost> shader_cost(const std::string& model_source);

}  // namespace veneer::cli
