// SPDX-License-Identifier: Apache-2.0
#include "render/evaluation.h"

namespace veneer::render {

Result<Evaluation> parse_evaluation(std::string_view text) {
  if (text == "fragment") return Evaluation::kFragment;
  if (text == "compute") return Evaluation::kCompute;
  return fail(
      Errc::kInvalidOption, "evaluation is \"{}\"; it may be \"fragment\" or \"compute\"", text);
}

}  // namespace veneer::render
