// SPDX-License-Identifier: Apache-2.0
#include "calibration/colour/colour_model.h"

#include <algorithm>
#include <array>

#include "calibration/colour/gog/gog.h"
#include "calibration/colour/interaction/interaction.h"
#include "calibration/colour/lut3d/lut3d.h"
#include "calibration/colour/pca_spline/pca_spline.h"
#include "calibration/colour/plcc/plcc.h"
#include "calibration/colour/plvc/plvc.h"
#include "calibration/colour/white_segment/white_segment.h"

namespace veneer::calibration {

std::span<const ColourModelFamily> colour_model_families() {
  static constexpr std::array kFamilies{
      ColourModelFamily{
          "gog", "gain, offset and exponent per channel, and a matrix", false, &fit_gog},
      ColourModelFamily{"interaction",
                        "pca2-spline and products of channels: crosstalk, a supply that gives way",
                        true,
                        &fit_interaction},
      ColourModelFamily{
          "lut3d", "tone curves and a measured cube of mixtures, tetrahedral", true, &fit_lut3d},
      ColourModelFamily{"pca1-spline",
                        "per channel its best colour, times a monotone cubic",
                        false,
                        &fit_pca1_spline},
      ColourModelFamily{
          "pca2-spline", "per channel its two best colours, times cubics", false, &fit_pca2_spline},
      ColourModelFamily{"plcc", "fixed chromaticity, piecewise linear luminance", false, &fit_plcc},
      ColourModelFamily{
          "plcc-spline", "fixed chromaticity, monotone cubic luminance", false, &fit_plcc_spline},
      ColourModelFamily{"plvc", "piecewise linear X, Y, Z per channel", false, &fit_plvc},
      ColourModelFamily{"plvc-spline", "cubic X, Y, Z per channel", false, &fit_plvc_spline},
      ColourModelFamily{"white-segment",
                        "pca2-spline and a light that the least channel drives: DLP with white",
                        true,
                        &fit_white_segment},
  };
  static_assert(std::ranges::is_sorted(kFamilies, {}, &ColourModelFamily::name));
  return kFamilies;
}

}  // namespace veneer::calibration
