// SPDX-License-Identifier: Apache-2.0
#include "projector/outputs/null/null_output.h"

namespace veneer::projector {

Result<std::unique_ptr<NullOutput>> NullOutput::open(TomlReader& /*config*/) {
  return std::make_unique<NullOutput>();
}

}  // namespace veneer::projector
