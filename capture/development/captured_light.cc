// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <utility>

#include "capture/development/internal_captured_light.h"
#include "capture/polarisation/mosaic.h"

namespace veneer::capture {
namespace {

/// Each angle interpolated to every pixel. Variances are those of the pixels themselves: between
/// them noise is less and shared, which the mean over a texel makes up for.
Result<std::vector<MergedPicture>> taken_apart(const MergedPicture& merged) {
  constexpr double kNeverFull = 1e30;
  VENEER_ASSIGN(MosaicCells light, demosaic(merged.light, kNeverFull, merged.mosaic));
  VENEER_ASSIGN(MosaicCells variance, demosaic(merged.variance, kNeverFull, merged.mosaic));
  Image<Rgb32f> full(merged.light.width(), merged.light.height());
  for (std::size_t i = 0; i < full.pixels().size(); ++i) {
    if (merged.saturated.pixels()[i] != 0) full.pixels()[i] = Rgb32f::Ones();
  }
  VENEER_ASSIGN(const MosaicCells spread, demosaic(full, 1, merged.mosaic));
  std::vector<MergedPicture> pictures;
  for (std::size_t angle = 0; angle < light.counts.size(); ++angle) {
    MergedPicture picture;
    picture.light = std::move(light.counts[angle]);
    picture.variance = std::move(variance.counts[angle]);
    picture.saturated = spread.saturated;
    for (std::uint8_t& pixel : picture.saturated.pixels()) pixel = pixel != 0 ? 7 : 0;
    picture.saturated_fraction = merged.saturated_fraction;
    pictures.push_back(std::move(picture));
  }
  return pictures;
}

}  // namespace

Result<CapturedBracket> captured_bracket(const Recording& recording, const Shot& first) {
  CapturedBracket bracket;
  Shot shot = first;
  for (shot.exposure = 0; recording.has(shot); ++shot.exposure) {
    Shot dark = shot;
    dark.dark = true;
    dark.analyser = 0;
    VENEER_ASSIGN(Picture lit_picture, recording.picture(shot));
    VENEER_ASSIGN(Picture dark_picture, recording.picture(dark));
    bracket.lit.push_back(std::move(lit_picture));
    bracket.dark.push_back(std::move(dark_picture));
  }
  if (bracket.lit.empty())
    return fail(Errc::kNotFound,
                "developing {}: {} seen from view {} under light {} was not captured; run veneer "
                "capture again with the same -o, it takes what is missing",
                recording.folder().string(),
                text_of(first.target),
                first.view,
                first.light);
  return bracket;
}

Result<std::vector<MergedPicture>> captured_light(const Recording& recording,
                                                  const Shot& shot,
                                                  const ResponseCurve& response,
                                                  const NoiseModel& noise) {
  std::vector<MergedPicture> pictures;
  Shot first = shot;
  const auto angles = static_cast<int>(recording.plan().polarisation.analyser_rad.size());
  for (first.analyser = 0; first.analyser < angles; ++first.analyser) {
    VENEER_ASSIGN(const CapturedBracket bracket, captured_bracket(recording, first));
    VENEER_ASSIGN(MergedPicture merged, merge(bracket.lit, bracket.dark, response, noise));
    if (merged.mosaic != Mosaic::kNone) return taken_apart(merged);
    pictures.push_back(std::move(merged));
  }
  return pictures;
}

}  // namespace veneer::capture
