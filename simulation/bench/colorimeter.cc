// SPDX-License-Identifier: Apache-2.0
#include "simulation/bench/colorimeter.h"

#include <algorithm>
#include <utility>

namespace veneer::simulation {

Status VirtualPatchDisplay::show(const std::array<std::uint16_t, 3>& code, bool lit) {
  const int full = (1 << bench_.truth().projector.bits) - 1;
  if (*std::ranges::max_element(code) > full)
    return fail(Errc::kInvalidOption,
                "showing a patch on the bench: code {}, {}, {} is over {}",
                code[0],
                code[1],
                code[2],
                full);
  code_ = code;
  lit_ = lit;
  picture_ = {};
  return {};
}

Status VirtualPatchDisplay::show_picture(ImageView<const Rgb16> codes) {
  const ProjectorTruth& projector = bench_.truth().projector;
  if (codes.width() != projector.width || codes.height() != projector.height)
    return fail(Errc::kInvalidOption,
                "showing a picture on the bench: it has {} x {} pixels, the projector {} x {}",
                codes.width(),
                codes.height(),
                projector.width,
                projector.height);
  const int full = (1 << projector.bits) - 1;
  Image<Rgb16> picture(codes.width(), codes.height());
  for (int y = 0; y < codes.height(); ++y) {
    for (int x = 0; x < codes.width(); ++x) {
      if (*std::ranges::max_element(codes(x, y)) > full)
        return fail(Errc::kInvalidOption,
                    "showing a picture on the bench: pixel {}, {} has a code over {}",
                    x,
                    y,
                    full);
      picture(x, y) = codes(x, y);
    }
  }
  picture_ = std::move(picture);
  lit_ = true;
  return {};
}

Result<Xyz> VirtualColorimeter::read(calibration::Target target, const Eigen::Vector2d& pixel) {
  const ProjectorTruth& projector = bench_.truth().projector;
  const bool on_raster =
      pixel.minCoeff() >= 0 && pixel.x() <= projector.width && pixel.y() <= projector.height;
  if (!on_raster)
    return fail(Errc::kInvalidOption,
                "reading a patch on the bench: pixel {}, {} is off the raster",
                pixel.x(),
                pixel.y());
  const Xyz light =
      bench_.board(display_.code(), pixel, display_.lit(), target == calibration::Target::kObject);
  Xyz reading = light;
  for (double& value : reading) value *= 1.0 + options_.relative_noise * random_.normal();
  for (double& value : reading) value += options_.dark_noise_nits * random_.normal();
  return reading;
}

calibration::ProjectorGeometry true_geometry(const Bench& bench) {
  const ProjectorTruth& p = bench.truth().projector;
  return {p.width,
          p.height,
          p.focal_px.x(),
          p.focal_px.y(),
          p.principal_point.x(),
          p.principal_point.y(),
          p.world_from_projector};
}

}  // namespace veneer::simulation
