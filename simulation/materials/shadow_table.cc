// SPDX-License-Identifier: Apache-2.0
#include "simulation/materials/shadow_table.h"

#include <array>
#include <cmath>

#include "base/parallel.h"

namespace veneer::simulation {

namespace {

constexpr std::uint8_t kLit = 255;

}  // namespace

ShadowTable::ShadowTable(const Relief& relief, const LightArray& lights, Progress& progress)
    : resolution_(relief.resolution()),
      lights_(lights.padded()),
      lit_(static_cast<std::size_t>(resolution_) * static_cast<std::size_t>(resolution_) * lights_,
           0) {
  const int n = resolution_;
  const auto facing = [&](int column, int row, std::size_t light) {
    return relief.normal({column, row, 0.5, 0.5, 0.0}).dot(lights.direction(light)) > 0.0;
  };
  const auto cell_of = [&](int column, int row) {
    return const_cast<std::uint8_t*>(cell(column, row));
  };

  progress.start("shadows", n);
  parallel_for(n, 1, [&](std::int64_t begin, std::int64_t end) {
    for (int row = static_cast<int>(begin); row < end; ++row) {
      for (int column = 0; column < n; ++column) {
        const Relief::Hit middle = relief.point(column, row, 0.5, 0.5);
        const Eigen::Vector3d normal = relief.normal(middle);
        const Eigen::Vector3d from = relief.lifted(middle, normal);
        for (std::size_t light = 0; light < lights.count; ++light) {
          const Eigen::Vector3d to_light = lights.direction(light);
          if (normal.dot(to_light) > 0.0 && !relief.first_hit(from, to_light)) {
            cell_of(column, row)[light] = kLit;
          }
        }
      }
      progress.advance();
    }
  });
  progress.finish();

  // Reads only cells that face the light, writes only cells that do not: no order matters.
  parallel_for(n, 1, [&](std::int64_t begin, std::int64_t end) {
    for (int row = static_cast<int>(begin); row < end; ++row) {
      for (int column = 0; column < n; ++column) {
        for (std::size_t light = 0; light < lights.count; ++light) {
          if (facing(column, row, light)) continue;
          int sum = 0;
          int count = 0;
          for (int dy = -1; dy <= 1; ++dy) {
            for (int dx = -1; dx <= 1; ++dx) {
              const int x = (column + dx + n) % n;
              const int y = (row + dy + n) % n;
              if (!facing(x, y, light)) continue;
              sum += cell(x, y)[light];
              ++count;
            }
          }
          if (count > 0) cell_of(column, row)[light] = static_cast<std::uint8_t>(sum / count);
        }
      }
    }
  });
}

const std::uint8_t* ShadowTable::cell(int column, int row) const {
  return lit_.data() + (static_cast<std::size_t>(row) * static_cast<std::size_t>(resolution_) +
                        static_cast<std::size_t>(column)) *
                           lights_;
}

void ShadowTable::look_up(const Relief::Hit& hit, std::span<float> out) const {
  const int n = resolution_;
  // Values stand at the middles of the cells.
  const int left = hit.u < 0.5 ? hit.column - 1 : hit.column;
  const int up = hit.v < 0.5 ? hit.row - 1 : hit.row;
  const auto fx = static_cast<float>(hit.u < 0.5 ? hit.u + 0.5 : hit.u - 0.5);
  const auto fy = static_cast<float>(hit.v < 0.5 ? hit.v + 0.5 : hit.v - 0.5);
  const int x0 = left < 0 ? n - 1 : left;
  const int y0 = up < 0 ? n - 1 : up;
  const int x1 = left + 1 == n ? 0 : left + 1;
  const int y1 = up + 1 == n ? 0 : up + 1;
  const std::uint8_t* const a = cell(x0, y0);
  const std::uint8_t* const b = cell(x1, y0);
  const std::uint8_t* const c = cell(x0, y1);
  const std::uint8_t* const d = cell(x1, y1);
  float* const lit = out.data();
  for (std::size_t i = 0; i < lights_; ++i) {
    // Differences, not weights: four equal values give exactly that value.
    const float upper = a[i] + fx * static_cast<float>(b[i] - a[i]);
    const float lower = c[i] + fx * static_cast<float>(d[i] - c[i]);
    lit[i] = (upper + fy * (lower - upper)) / static_cast<float>(kLit);
  }
}

}  // namespace veneer::simulation
