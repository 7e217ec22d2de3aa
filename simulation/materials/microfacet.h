// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <numbers>

// The terms of the interface's reflection, in float and small enough to be inlined into loops that
// the compiler turns into vector code.

namespace veneer::simulation {

/// GGX normal distribution D(m), in 1/sr; isotropic.
///
/// @param cos_m  cosine between the normal and the microfacet's normal; <= 0 is the caller's to
/// sort
///   out (the formula is even in it).
/// @param alpha  roughness width, in [0.03, 1]: below, (cos_m^2 (alpha^2 - 1) + 1) drowns in
/// float's
///   rounding.
/// Source: Walter et al. 2007, "Microfacet Models for Refraction through Rough Surfaces", the GGX
/// distribution, rewritten in cos(theta) to avoid tan() near grazing.
[[nodiscard]] inline float ggx_ndf(float cos_m, float alpha) {
  const float alpha_sq = alpha * alpha;
  const float base = cos_m * cos_m * (alpha_sq - 1.0F) + 1.0F;
  return alpha_sq / (std::numbers::pi_v<float> * base * base);
}

/// sqrt(alpha^2 + (1 - alpha^2) cos^2): the part of Smith's term that depends on one direction
/// alone.
[[nodiscard]] inline float smith_root(float cosine, float alpha) {
  const float alpha_sq = alpha * alpha;
  return std::sqrt(alpha_sq + (1.0F - alpha_sq) * cosine * cosine);
}

/// G2 / (4 cos_l cos_v), height-correlated: 1 / (2 (cos_l root_v + cos_v root_l)). Finite unless
/// both cosines are 0. Source: Heitz 2014, "Understanding the Masking-Shadowing Function in
/// Microfacet-Based BRDFs", the height-correlated form with GGX's Lambda inserted.
[[nodiscard]] inline float smith_visibility(float cos_l, float root_l, float cos_v, float root_v) {
  return 0.5F / (cos_l * root_v + cos_v * root_l);
}

/// (1 - cosine)^5 of Schlick's Fresnel term.
/// @param cosine  in [0, 1]
/// Source: Schlick 1994, "An Inexpensive BRDF Model for Physically-Based Rendering".
[[nodiscard]] inline float schlick_weight(float cosine) {
  const float c = 1.0F - cosine;
  const float c_sq = c * c;
  return c_sq * c_sq * c;
}

/// Reflectance at grazing incidence. 1 for every real interface; it falls to 0 with f0 below 0.02,
/// which no solid has, so that f0 = 0 means "no interface" without a step.
[[nodiscard]] inline float grazing_reflectance(const Eigen::Vector3f& f0) {
  return std::min(1.0F, 50.0F * f0.maxCoeff());
}

/// F(theta) = f0 + (f90 - f0) (1 - cos)^5.
[[nodiscard]] inline Eigen::Vector3f fresnel(const Eigen::Vector3f& f0, float cosine) {
  return f0 + (Eigen::Vector3f::Constant(grazing_reflectance(f0)) - f0) * schlick_weight(cosine);
}

/// A microfacet normal drawn in proportion to the area that `view` sees, in the frame where the
/// normal is z.
/// @param view  unit, z > 0   @param u1, u2  uniform in [0, 1)
/// Source: Heitz 2018, "Sampling the GGX Distribution of Visible Normals", JCGT 7(4).
[[nodiscard]] inline Eigen::Vector3d sample_visible_normal(const Eigen::Vector3d& view,
                                                           double alpha,
                                                           double u1,
                                                           double u2) {
  // In the stretched frame the microsurface is a hemisphere; its visible part projects to a disc of
  // which one half is squeezed by the view's elevation.
  const Eigen::Vector3d stretched =
      Eigen::Vector3d(alpha * view.x(), alpha * view.y(), view.z()).normalized();
  const double flat_sq = stretched.x() * stretched.x() + stretched.y() * stretched.y();
  const Eigen::Vector3d across =
      flat_sq > 0.0 ? Eigen::Vector3d(Eigen::Vector3d(-stretched.y(), stretched.x(), 0.0) /
                                      std::sqrt(flat_sq))
                    : Eigen::Vector3d::UnitX();
  const Eigen::Vector3d along = stretched.cross(across);
  const double radius = std::sqrt(u1);
  const double angle = 2.0 * std::numbers::pi * u2;
  const double t1 = radius * std::cos(angle);
  const double squeeze = 0.5 * (1.0 + stretched.z());
  const double t2 = (1.0 - squeeze) * std::sqrt(1.0 - t1 * t1) + squeeze * radius * std::sin(angle);
  const double t3 = std::sqrt(std::max(0.0, 1.0 - t1 * t1 - t2 * t2));
  const Eigen::Vector3d normal = t1 * across + t2 * along + t3 * stretched;
  return Eigen::Vector3d(alpha * normal.x(), alpha * normal.y(), std::max(1e-9, normal.z()))
      .normalized();
}

/// G2(view, light) / G1(view): what is left of a sample drawn by sample_visible_normal() and
/// reflected there. In [0, 1]; both cosines > 0.
[[nodiscard]] inline float masking_ratio(float cos_v, float cos_l, float alpha) {
  const float root_v = smith_root(cos_v, alpha);
  // G1(v) = 2 cos_v / (cos_v + root_v); G2 = 4 cos_l cos_v * smith_visibility.
  return 2.0F * cos_l * (cos_v + root_v) *
         smith_visibility(cos_l, smith_root(cos_l, alpha), cos_v, root_v);
}

}  // namespace veneer::simulation
