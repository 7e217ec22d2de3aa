// SPDX-License-Identifier: Apache-2.0
#include "capture/cameras/layout.h"

#include <string>

#include "capture/polarisation/mosaic.h"

namespace veneer::capture {

Result<Mosaic> read_layout(TomlReader& config) {
  if (!config.contains("layout")) return Mosaic::kNone;
  std::string name;
  config.read("layout", name);
  Result<Mosaic> mosaic = mosaic_named(name);
  if (!mosaic) return fail_while("opening the camera: the key layout", mosaic.error());
  return mosaic;
}

int cell_size(Mosaic mosaic) {
  switch (mosaic) {
    case Mosaic::kNone:
      return 1;
    case Mosaic::kPolarMono:
      return 2;
    case Mosaic::kPolarColour:
      return 4;
  }
  return 1;
}

Status check_layout(Mosaic mosaic, int width, int height) {
  const int cell = cell_size(mosaic);
  if (width % cell == 0 && height % cell == 0) return {};
  return fail(Errc::kInvalidOption,
              "{} x {} pixels are no whole number of the layout's cells of {} x {}: the pictures "
              "are cropped or scaled, or the layout is another; take them whole as the sensor has "
              "them",
              width,
              height,
              cell,
              cell);
}

}  // namespace veneer::capture
