// SPDX-License-Identifier: Apache-2.0
#include "simulation/bench/colorimeter.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace veneer::simulation {
namespace {

constexpr double kReading_s = 1;  // what a filter colorimeter takes for one

}  // namespace

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
  ++shown_;
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
  ++shown_;
  return {};
}

double VirtualPatchDisplay::lamp() const {
  if (!lit_) return 0;
  const ProjectorTruth& projector = bench_.truth().projector;
  const double on_s = to_seconds(now().time_since_epoch());
  return 1.0 - projector.lamp_drift * std::exp(-on_s / projector.lamp_settling_s);
}

VirtualColorimeterOptions options_from(const InstrumentTruth& truth) {
  return {truth.relative_noise,
          truth.dark_noise_nits,
          truth.seed,
          truth.drift_per_hour,
          truth.matrix_error};
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
  display_.pass(kReading_s);
  const Image<Rgb16>& picture = display_.picture();
  const Rgb16 code = picture.empty()
                         ? display_.code()
                         : picture(std::min(static_cast<int>(pixel.x()), projector.width - 1),
                                   std::min(static_cast<int>(pixel.y()), projector.height - 1));
  const Xyz light =
      bench_.board(code, pixel, display_.lamp(), target == calibration::Target::kObject);
  const double hours = to_seconds(display_.now().time_since_epoch()) / 3600.0;
  Xyz reading = (1.0 + options_.drift_per_hour * hours) * (light + options_.matrix_error * light);
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
