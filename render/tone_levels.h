// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

namespace veneer::render {

/// The distinct outputs of one tone curve, ready to find the two that bracket a wanted output.
/// Codes that give the same output are one level, drawn with the lowest of them.
class ToneLevels {
 public:
  /// Pieces of [0, 1], equal in sqrt(t), for each of which the search starts from a narrow range.
  static constexpr int kSeeds = 1024;

  /// @param curve  output of every code, not falling, from 0 to 1, at most 65536 long.
  explicit ToneLevels(std::span<const double> curve);

  /// Output `t` lies the part `fraction` in [0, 1) of the way from that of `lower` to that of
  /// `upper`.
  struct Bracket {
    std::uint16_t lower{};
    std::uint16_t upper{};
    double fraction{};
  };
  /// @param t  in [0, 1].
  [[nodiscard]] Bracket bracket(double t) const;

  /// Strictly rising, 0 first and 1 last. In float, as the shader has them.
  [[nodiscard]] std::span<const float> levels() const& { return levels_; }
  std::span<const float> levels() const&& = delete;
  /// The code of each level.
  [[nodiscard]] std::span<const std::uint16_t> codes() const& { return codes_; }
  std::span<const std::uint16_t> codes() const&& = delete;
  /// For t with floor(sqrt(t) kSeeds) = i, the highest level that is not above t is one of
  /// seeds()[i][0] to seeds()[i][1], even if the sqrt is off by a few ulp.
  [[nodiscard]] std::span<const std::array<std::uint16_t, 2>> seeds() const& { return seeds_; }
  std::span<const std::array<std::uint16_t, 2>> seeds() const&& = delete;

 private:
  std::vector<float> levels_;
  std::vector<std::uint16_t> codes_;
  std::vector<std::array<std::uint16_t, 2>> seeds_;
};

}  // namespace veneer::render
