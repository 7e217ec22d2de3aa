// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <array>
#include <span>
#include <vector>

#include "btf/direction.h"

namespace veneer::btf {

/// Exponents that are fitted. Below 1 a lobe's slope is not bounded where its base is 0; above the
/// other it is narrower than any measured grid resolves, and a coefficient in float16 (2^-12)
/// moves its value by more than 5 %.
inline constexpr float kLeastExponent = 1.0F;
inline constexpr float kMostExponent = 200.0F;
/// Numbers of a stored lobe: c and n of max(0, c . u)^n.
inline constexpr int kLobeValues = 4;

/// max(0, c . u)^n of a stored lobe: 0 where the base is not positive. @param stored  c, n.
[[nodiscard]] double lobe_value(std::span<const Eigen::half> stored, const Eigen::Vector3d& u);

/// What a lobe's coordinates u are.
enum class LobeSpace {
  kPair,   ///< view times light, element by element: Lafortune et al. 1997, eq. 8
  kLight,  ///< the light direction alone: Meseth, Mueller, Klein 2003
};

/// Where the samples of a fit lie; one row each.
struct LobeSamples {
  LobeSpace space;
  Eigen::ArrayX3f u;
  Eigen::ArrayXf cosine;  ///< light.z, which the model carries outside
};

/// A lobe while it is fitted: amplitude * max(0, c . u)^exponent. c is such that the base is at
/// most 1 for any directions, so that c moves the peak and the exponent its width only.
struct LobeShape {
  Eigen::Vector3f c;
  float exponent;
  float amplitude = 1.0F;
};

/// A fit in the numbers that are stored, all finite, colours >= 0.
struct StoredLobes {
  std::array<Eigen::half, 3> diffuse{};
  std::array<Eigen::half, 3> specular{};
  std::vector<Eigen::half> lobes;  ///< [lobe][kLobeValues]
  double squared_error = 0.0;      ///< weighted, of what is stored
};

/// The values to fit, each row times its weight; one column for each of R, G, B.
struct LobeTargets {
  Eigen::ArrayXf weight;
  Eigen::MatrixX3f rgb;
};

/// Whether a fit finds the diffuse colour, or has it taken off the targets already.
enum class Diffuse { kFree, kGiven };

/// Fits cosine * (diffuse + specular * sum of lobes) to RGB by least squares: Levenberg and
/// Marquardt over the lobes, with the colours (>= 0) eliminated by variable projection in Kaufman's
/// approximation (Golub and Pereyra 1973; Kaufman 1975), so that all three channels share one Gram
/// matrix a step. Lobes are added one at a time, each from the best of several starts, which a few
/// steps on a part of the samples tell; the last refinement takes all. Exponents are bounded so
/// that a lobe rises between and beyond the samples to at most four times what it has there.
/// Deterministic; thread-safe.
class LobeFitter {
 public:
  /// @param lobes  1 to 4. Samples: at least one row, finite.
  LobeFitter(LobeSamples samples, int lobes);
  [[nodiscard]] const LobeSamples& samples() const { return all_; }

  /// Lobes found from the starts, with the diffuse colour free.
  [[nodiscard]] std::vector<LobeShape> fit(const LobeTargets& targets,
                                           std::span<const LobeShape> starts) const;
  /// Improves lobes on all samples; never makes them worse.
  void refine(const LobeTargets& targets, Diffuse diffuse, std::vector<LobeShape>& shapes) const;
  /// Rounds the lobes to what is stored, then solves for the colours that suit them best. Lobes
  /// that `shapes` does not have are stored as 0.
  [[nodiscard]] StoredLobes store(const LobeTargets& targets,
                                  Diffuse diffuse,
                                  std::span<const LobeShape> shapes) const;
  /// Stored lobes as a start for another refinement.
  [[nodiscard]] static std::vector<LobeShape> shapes_of(const StoredLobes& stored);
  /// cosine times the sum of stored lobes, for each sample.
  [[nodiscard]] Eigen::ArrayXf lobes_at_samples(const StoredLobes& stored) const;

 private:
  LobeSamples all_;
  LobeSamples part_;
  std::vector<Eigen::Index> part_rows_;  // of all_
  int lobes_;
};

}  // namespace veneer::btf
