// SPDX-License-Identifier: Apache-2.0
#include "simulation/materials/ring_directions.h"

#include <array>
#include <span>

#include "base/units.h"

namespace veneer::simulation {

namespace {

struct Ring {
  double theta_deg;
  int azimuths;
  double first_azimuth_deg;
};

constexpr std::array kRings1{Ring{0, 1, 0}};
constexpr std::array kRings25{Ring{0, 1, 0}, Ring{25, 4, 0}, Ring{50, 8, 0}, Ring{75, 12, 0}};
constexpr std::array kRings49{
    Ring{0, 1, 0}, Ring{18.75, 6, 0}, Ring{37.5, 10, 0}, Ring{56.25, 14, 0}, Ring{75, 18, 0}};
constexpr std::array kRings151{Ring{0, 1, 0},
                               Ring{11, 6, 15},
                               Ring{23.5, 12, 0},
                               Ring{30, 12, 15},
                               Ring{37.5, 12, 0},
                               Ring{45, 18, 0},
                               Ring{52.5, 18, 7.5},
                               Ring{60, 24, 0},
                               Ring{67.5, 24, 7.5},
                               Ring{75, 24, 0}};

btf::DirectionSet directions_of(std::span<const Ring> rings) {
  btf::DirectionSet directions;
  for (const Ring& ring : rings) {
    for (int i = 0; i < ring.azimuths; ++i) {
      const Degrees phi{ring.first_azimuth_deg + 360.0 * i / ring.azimuths};
      directions.push_back(btf::direction_from_angles(
          {to_radians(Degrees{ring.theta_deg}).value, to_radians(phi).value}));
    }
  }
  return directions;
}

}  // namespace

Result<btf::DirectionSet> ring_directions(int count) {
  switch (count) {
    case 1:
      return directions_of(kRings1);
    case 25:
      return directions_of(kRings25);
    case 49:
      return directions_of(kRings49);
    case 81:
      return btf::bonn_directions();
    case 151:
      return directions_of(kRings151);
    default:
      return fail(
          Errc::kInvalidOption,
          "choosing directions: there is no set of {}; there are sets of 1, 25, 49, 81 and 151",
          count);
  }
}

}  // namespace veneer::simulation
