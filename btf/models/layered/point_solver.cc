// SPDX-License-Identifier: Apache-2.0
#include "btf/models/layered/point_solver.h"

#include <Eigen/Cholesky>

#include <algorithm>
#include <cmath>

#include "btf/models/lobes/lobe_fit.h"

namespace veneer::btf {
namespace {

// Where the unknowns stand.
constexpr int kDiffuse = 0;
constexpr int kSpecular = 3;
constexpr int kLobe = 6;
constexpr int kExponent = 9;
constexpr int kNormal = 10;
constexpr int kRadiance = 13;

// A base below this adds nothing to any lobe of an exponent from 1 on, and has a logarithm.
constexpr float kLeastBase = 1e-6F;
// Of the information's mean diagonal: holds what the data do not say.
constexpr double kDamping = 1e-4;
// Light from all around is no brighter than what comes straight.
constexpr float kMostRadiance = 1.0F;

}  // namespace

void lobe_rows(const LayerPoint& point, const Eigen::ArrayX3f& u, Eigen::ArrayXf& out) {
  out = (u.matrix() * point.lobe).array();
  out = (out > kLeastBase).select((out.max(kLeastBase).log() * point.exponent).exp(), 0.0F);
}

PointSolver::PointSolver(const LayerPoint& start, bool with_radiance, float most_colour)
    : point_(start), with_radiance_(with_radiance), most_colour_(most_colour) {}

void PointSolver::add(const PointView& view,
                      const Eigen::ArrayXf& shade,
                      const Eigen::ArrayX3f& lights) {
  const Eigen::Index count = lights.rows();
  const Eigen::ArrayXf cosine = (lights.matrix() * point_.normal).array();
  const Eigen::ArrayXf lit =
      (cosine > 0.0F).select(shade + point_.diffuse_radiance, 0.0F) * view.visible;
  lobe_rows(point_, view.u, lobe_);
  const Eigen::ArrayXf shine = lit * cosine;
  const Eigen::ArrayXf base = (view.u.matrix() * point_.lobe).array().max(kLeastBase);
  // d/d base, and d/d log k, of the lobe.
  const Eigen::ArrayXf slope = point_.exponent * lobe_ / base;
  const Eigen::ArrayXf growth = point_.exponent * lobe_ * base.log();
  jacobian_.setZero(3 * count, kUnknowns);
  Eigen::VectorXf residual(3 * count);
  for (int c = 0; c < 3; ++c) {
    auto rows = jacobian_.middleRows(c * count, count);
    const float specular = point_.specular[c];
    rows.col(kDiffuse + c) = shine;
    rows.col(kSpecular + c) = shine * lobe_;
    for (int i = 0; i < 3; ++i) {
      rows.col(kLobe + i) = specular * shine * slope * view.u.col(i);
      rows.col(kNormal + i) = lit * (point_.diffuse[c] + specular * lobe_) * lights.col(i);
    }
    if (with_radiance_)
      rows.col(kRadiance) =
          view.visible * cosine.max(0.0F) * (point_.diffuse[c] + specular * lobe_);
    rows.col(kExponent) = specular * shine * growth;
    residual.segment(c * count, count) = shine * (point_.diffuse[c] + specular * lobe_) +
                                         view.visible * point_.transmittance * view.below.col(c) -
                                         view.wanted.col(c);
  }
  if (view.weight.size() > 0) {
    const Eigen::ArrayXf root = view.weight.sqrt().replicate(3, 1);
    jacobian_.array().colwise() *= root;
    residual.array() *= root;
  }
  information_ += (jacobian_.transpose() * jacobian_).cast<double>();
  gradient_ += (jacobian_.transpose() * residual).cast<double>();
}

bool PointSolver::step(double forgetting) {
  const double scale = information_.diagonal().mean();
  if (!(scale > 0.0) || !std::isfinite(scale)) {
    gradient_.setZero();
    return false;
  }
  Matrix system = information_;
  // What each unknown is held by: its own information, and a little of all.
  system.diagonal() += kDamping * (information_.diagonal().array() + 0.01 * scale).matrix();
  const Eigen::Vector3d normal = point_.normal.cast<double>();
  const Eigen::Vector3d lobe = point_.lobe.cast<double>();
  // Lengths that colours stand for are not moved.
  system.block<3, 3>(kNormal, kNormal) += scale * normal * normal.transpose();
  system.block<3, 3>(kLobe, kLobe) += scale * lobe * lobe.transpose() / lobe.squaredNorm();
  if (!with_radiance_) system(kRadiance, kRadiance) = 1.0;
  const Vector change = system.ldlt().solve(gradient_);
  information_ *= forgetting;
  gradient_.setZero();
  if (!change.allFinite()) return false;

  LayerPoint next = point_;
  const Eigen::Matrix<float, kUnknowns, 1> by = -change.cast<float>();
  next.diffuse += by.segment<3>(kDiffuse);
  next.specular += by.segment<3>(kSpecular);
  next.lobe += by.segment<3>(kLobe).cwiseMax(-0.5F).cwiseMin(0.5F);
  next.exponent *= std::exp(std::clamp(by[kExponent], -0.7F, 0.7F));
  next.exponent = std::clamp(next.exponent, kLeastExponent, kMostExponent);
  next.diffuse_radiance = std::clamp(next.diffuse_radiance + by[kRadiance], 0.0F, kMostRadiance);
  next.normal += by.segment<3>(kNormal).cwiseMax(-0.5F).cwiseMin(0.5F);

  const float largest = next.lobe.cwiseAbs().maxCoeff();
  const float length = next.normal.norm();
  if (!(largest > 1e-3F) || !(length > 1e-3F)) return false;
  next.normal /= length;
  next.lobe /= largest;
  const float peak = std::pow(largest, next.exponent) * length;
  next.diffuse = (next.diffuse * length).cwiseMax(0.0F).cwiseMin(most_colour_);
  next.specular = (next.specular * peak)
                      .cwiseMax(0.0F)
                      .cwiseMin((most_colour_ - next.diffuse.array()).matrix());
  // From below, no light of the sample's could be told from none.
  if (next.normal.z() < 0.0F) {
    next.normal.z() = 0.0F;
    const float rest = next.normal.norm();
    if (!(rest > 1e-3F)) return false;
    next.normal /= rest;
  }
  if (!next.diffuse.allFinite() || !next.specular.allFinite() || !next.lobe.allFinite())
    return false;
  point_ = next;
  return true;
}

LayerPoint start_of(std::span<const PointView> views,
                    std::span<const int> order,
                    const Eigen::ArrayXf& arrived,
                    const Eigen::ArrayX3f& lights) {
  const Eigen::ArrayXf cosine = lights.col(2) * arrived;
  Eigen::Vector3d above = Eigen::Vector3d::Zero();
  double below = 0.0;
  for (const int v : order) {
    const PointView& view = views[static_cast<std::size_t>(v)];
    const Eigen::ArrayXf weighted =
        view.weight.size() > 0 ? Eigen::ArrayXf(cosine * view.weight) : cosine;
    above += double(view.visible) *
             (view.wanted.matrix().transpose() * weighted.matrix()).cast<double>();
    below += double(view.visible) * double(view.visible) * double((weighted * cosine).sum());
  }
  LayerPoint start;
  if (below > 0.0) start.diffuse = (above / below).cast<float>().cwiseMax(0.0F);
  start.specular = Eigen::Vector3f::Constant(0.1F * start.diffuse.mean());
  start.exponent = 4.0F;
  return start;
}

}  // namespace veneer::btf
