// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <numbers>

#include "simulation/materials/internal_materials.h"
#include "simulation/materials/internal_noise.h"
#include "simulation/materials/synthesize.h"

namespace veneer::simulation {

namespace {

// Lengths in tile widths unless said.
constexpr int kThreads = 8;           // a tile, in both directions; a multiple of the twill's 4
constexpr double kHalfWidth = 0.47;   // of a thread, in thread pitches
constexpr double kThickness = 0.024;  // of a thread above its middle line
constexpr double kWave = 0.016;       // of its middle line, over and under
constexpr double kGapDepth = -0.016;  // where no thread covers
constexpr int kTwist = 24;            // strands of the yarn a tile, along a thread
constexpr double kStrandHeight = 0.0013;

// What lies at a place: how high, and the thread it belongs to.
struct Strand {
  double height;
  double twist;  // in [-1, 1], across the strands of the yarn
  int thread;    // -1 in a gap
};

// 2/2 twill: is this warp thread over that weft thread?
double warp_side(int warp, int weft) { return ((warp + weft) % 4 + 4) % 4 < 2 ? 1.0 : -1.0; }

// A thread that runs along `along`. side(k) says whether it is over (1) or under (-1) the k-th
// crossing thread; `across` and `along` are in thread pitches.
template <class Side>
Strand thread_at(double along, double across, const Side& side) {
  const int thread = static_cast<int>(std::floor(across));
  const double off = (across - thread - 0.5) / kHalfWidth;
  if (std::abs(off) >= 1.0) return {kGapDepth, 0.0, -1};
  const int crossing = static_cast<int>(std::floor(along - 0.5));
  const double way = smooth_step(0.0, 1.0, along - 0.5 - crossing);
  const double level = std::lerp(side(thread, crossing), side(thread, crossing + 1), way);
  const double twist = std::sin(2.0 * std::numbers::pi * (along * kTwist / kThreads + 0.6 * off));
  const double height =
      kWave * level + kThickness * std::sqrt(1.0 - off * off) + kStrandHeight * twist;
  return {height, twist, thread};
}

Strand warp_at(double x, double y) {
  return thread_at(
      y * kThreads, x * kThreads, [](int warp, int weft) { return warp_side(warp, weft); });
}

Strand weft_at(double x, double y) {
  return thread_at(
      x * kThreads, y * kThreads, [](int weft, int warp) { return -warp_side(warp, weft); });
}

}  // namespace

// Indigo warp (along y) and cream weft (along x) in a 2/2 twill.
HeightField make_cloth(int size, std::uint64_t seed) {
  const auto height_at = [](double x, double y) {
    return std::max({kGapDepth, warp_at(x, y).height, weft_at(x, y).height});
  };
  const auto surface_at = [seed](double x, double y) {
    const Strand warp = warp_at(x, y);
    const Strand weft = weft_at(x, y);
    const bool warp_on_top = warp.height > weft.height;
    const Strand& top = warp_on_top ? warp : weft;
    // Threads differ a little in dye, strands catch dust between them, and all is a little uneven.
    const double dye = 0.14 * (lattice_random(top.thread, warp_on_top ? 1 : 0, seed) - 0.5);
    const double uneven = 0.06 * cloud_noise(x, y, 16, 2, seed + 5);
    const double gap = top.thread < 0 ? 0.35 : 1.0;
    const auto tone = static_cast<float>(gap * (1.0 + dye + uneven + 0.10 * top.twist));
    Surface surface;
    surface.albedo = (warp_on_top ? Eigen::Vector3f(0.085F, 0.16F, 0.39F)
                                  : Eigen::Vector3f(0.80F, 0.67F, 0.43F)) *
                     tone;
    // More than bare fibre (0.05): a lacquered satin yarn, whose broad highlight is plain to see.
    surface.f0 = Eigen::Vector3f::Constant(0.30F);
    surface.alpha = 0.30F;
    return surface;
  };
  return sampled_field(size * kCellsPerTexel, 8.0, height_at, surface_at);
}

}  // namespace veneer::simulation
