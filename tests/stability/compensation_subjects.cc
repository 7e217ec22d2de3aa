// SPDX-License-Identifier: Apache-2.0
#include "tests/stability/compensation_subjects.h"

#include "render/internal_testing.h"

namespace veneer::stability {
namespace {

using calibration::ProjectorProfile;
using Eigen::Vector3d;

void flat_below_half(ProjectorProfile& profile, render::RendererOptions& /*options*/) {
  for (auto& curve : profile.tone_curves)
    for (std::size_t i = 0; i < curve.size() / 2; ++i) curve[i] = 0;
}
void one_step(ProjectorProfile& profile, render::RendererOptions& /*options*/) {
  for (auto& curve : profile.tone_curves)
    for (std::size_t i = 0; i < curve.size(); ++i) curve[i] = i < curve.size() / 2 ? 0 : 1;
}
// The third primary nearly in the plane of the others: just above what check() refuses.
void nearly_singular(ProjectorProfile& profile, render::RendererOptions& /*options*/) {
  auto& m = profile.primaries;
  m.col(2) = m.col(0) + m.col(1) + 1e-4 * m.col(2);
}

const CompensationSubject kSubjects[] = {
    {"Bits8", 8, [](ProjectorProfile&, render::RendererOptions&) {}},
    {"Bits10", 10, [](ProjectorProfile&, render::RendererOptions&) {}},
    {"Bits12", 12, [](ProjectorProfile&, render::RendererOptions&) {}},
    {"Bits16", 16, [](ProjectorProfile&, render::RendererOptions&) {}},
    {"FlatCurve", 8, &flat_below_half},
    {"StepCurve", 8, &one_step},
    {"NearlySingularPrimaries", 8, &nearly_singular},
    {"Residual",
     8,
     [](ProjectorProfile& p, render::RendererOptions&) {
       p.residual = render::example_residual();
     }},
    {"NoBlackNoAmbient",
     8,
     [](ProjectorProfile& p, render::RendererOptions&) {
       p.black.setZero();
       p.ambient.setZero();
     }},
    {"BlackOf1000Nits",
     8,
     [](ProjectorProfile& p, render::RendererOptions&) { p.black = Vector3d(950, 1000, 1090); }},
    {"AmbientOf1e7Lux",
     8,
     [](ProjectorProfile& p, render::RendererOptions&) {
       p.ambient = 3.2e6 * Vector3d(0.95, 1, 1.09);
     }},
    {"CeilingOf1e-9",
     8,
     [](ProjectorProfile&, render::RendererOptions& o) { o.luminance_ceiling = 1e-9; }},
    {"CeilingOf20",
     8,
     [](ProjectorProfile&, render::RendererOptions& o) { o.luminance_ceiling = 20; }},
    {"Uncompensated",
     8,
     [](ProjectorProfile&, render::RendererOptions& o) { o.compensate = false; }},
};

}  // namespace

std::span<const CompensationSubject> compensation_subjects() { return kSubjects; }

}  // namespace veneer::stability
