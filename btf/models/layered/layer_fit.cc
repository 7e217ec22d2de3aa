// SPDX-License-Identifier: Apache-2.0
#include "btf/models/layered/layer_fit.h"

namespace veneer::btf {

Result<LayerFit> fit_layers(const SampleSet& /*set*/,
                            const FittedPairs& pairs,
                            const FitOptions& /*options*/,
                            Progress& /*progress*/) {
  return LayerFit{LayerStack(pairs.frame().width, pairs.frame().height, {0.0F})};
}

}  // namespace veneer::btf
