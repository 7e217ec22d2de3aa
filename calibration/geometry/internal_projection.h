// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace veneer::geometry {

/// The formula of Lens for any number type: what Lens::project and the fits share.
/// @param lens  fx, fy, cx, cy, k1, k2, p1, p2, k3.   @returns false for a point not in front.
template <class L, class T>
[[nodiscard]] bool project_with(const L* lens, const T* point, T* pixel) {
  if (!(point[2] > T(0))) return false;
  const T x = point[0] / point[2];
  const T y = point[1] / point[2];
  const T r2 = x * x + y * y;
  const T radial = T(1) + r2 * (lens[4] + r2 * (lens[5] + r2 * lens[8]));
  const T dx = T(2) * lens[6] * x * y + lens[7] * (r2 + T(2) * x * x);
  const T dy = lens[6] * (r2 + T(2) * y * y) + T(2) * lens[7] * x * y;
  pixel[0] = lens[0] * (x * radial + dx) + lens[2];
  pixel[1] = lens[1] * (y * radial + dy) + lens[3];
  return true;
}

}  // namespace veneer::geometry
