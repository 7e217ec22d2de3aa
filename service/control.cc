// SPDX-License-Identifier: Apache-2.0
#include "service/control.h"

namespace veneer::service {

Status LightSetting::check() const {
  constexpr double kMost = 1e6;  // lux; ten times the sun
  if (!direction_to_light.allFinite() || !(direction_to_light.norm() > 1e-9) ||
      !(direction_to_light.norm() < 1e9))
    return fail(Errc::kInvalidOption, "setting a light: its direction is no direction");
  if (!(illuminance_lux >= 0 && illuminance_lux <= kMost))
    return fail(
        Errc::kInvalidOption, "setting a light: {} lux is outside 0 to {}", illuminance_lux, kMost);
  if (!colour.allFinite() || !(colour.minCoeff() >= 0) || !(colour.maxCoeff() <= kMost))
    return fail(Errc::kInvalidOption, "setting a light: its colour is negative or not a number");
  return {};
}

}  // namespace veneer::service
