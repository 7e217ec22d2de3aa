// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "base/image.h"
#include "base/rigid_transform.h"
#include "simulation/bench.h"
#include "simulation/bench/truth.h"

namespace veneer::simulation {

/// What each pixel of a camera sees of the object in one pose, as BoardView does of the board.
class ObjectView {
 public:
  ObjectView(const Bench& bench,
             const CameraTruth& camera,
             const RigidTransform& world_from_object);

  /// What a light is on the object's two reflectances, the second of them painted.
  template <class Light>
  using OnObject = std::array<Light, 2>;

  /// Mean light of every pixel; black past the object.
  /// @param raster  light of every raster pixel that the object sends where G = 1, black included,
  ///                lamp settled, in any unit, as the camera's channels see it.
  /// @param lamp  in parts of its settled light.   @param ambient  the same of the ambient light.
  [[nodiscard]] Image<Rgb32f> gather(const OnObject<Image<Rgb32f>>& raster,
                                     float lamp,
                                     const OnObject<Rgb32f>& ambient) const;

 private:
  struct Sample {
    std::int32_t raster_pixel;  // -1: not lit
    float geometry;             // G, in parts of the pixel's rays
    bool painted;
  };
  int width_;
  int height_;
  float part_of_ray_;                 // of a pixel
  std::vector<std::uint32_t> first_;  // samples of pixel i: [first[i], first[i + 1])
  std::vector<Sample> samples_;
};

}  // namespace veneer::simulation
