// SPDX-License-Identifier: Apache-2.0
// Where object, eye, lights and projector may stand: what is drawn is finite, and on any doubt dark
// rather than white.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <variant>

#include "render/egl_context.h"
#include "render/internal_testing.h"
#include "render/renderer.h"

namespace veneer::render {
namespace {

using calibration::ProjectorProfile;
using Eigen::Vector3d;

constexpr int kWidth = 96;
constexpr int kHeight = 72;
constexpr double kPi = std::numbers::pi;

struct Setting {
  Scene scene;
  ProjectorProfile profile = example_profile(kWidth, kHeight, 8);
  FrameInput input{{-0.1, 0.1, 0.8}, {}, 0};
};

/// What must be seen; of all, nothing may be no number.
enum class Seen {
  kNothing,     ///< no pixel is covered
  kNoLight,     ///< something is covered, and the target is 0 everywhere
  kOutOfReach,  ///< something is covered, and no pixel of it is driven
  kPicture,     ///< something is covered, all of it in Lambert's light or in less
  kFault,       ///< something is covered, no pixel of it is driven, none has a finite target
  kAnything     ///< whatever the raster resolves of it, as kPicture
};

struct Geometry {
  const char* name;
  const char* mesh;
  Seen seen;
  void (*change)(Setting&);
};

void field_of_view(Setting& s, double degrees) {
  auto& g = s.profile.geometry;
  g.fx = g.fy = 0.5 * kWidth / std::tan(0.5 * degrees * kPi / 180);
  g.cx = 0.5 * kWidth;
  g.cy = 0.5 * kHeight;
}
void lamp_at(Setting& s, const Vector3d& position) {
  s.scene.lights = {PointLight{position, Vector3d::Constant(kPi)}};
}
void sun_of(Setting& s, double lux) {
  s.scene.lights = {
      DirectionalLight{Vector3d(0.3, 0.5, 0.8).normalized(), Vector3d::Constant(lux)}};
}
const Vector3d& projector_of(const Setting& s) {
  return s.profile.geometry.world_from_projector.translation;
}
/// A point of the projector's axis. @param z  metres from it.
Vector3d before_projector(const Setting& s, double z) {
  return s.profile.geometry.world_from_projector.rotation * Vector3d(0, 0, z) + projector_of(s);
}
/// Triangles without area: three equal corners, two equal ones, and three in a line; without
/// normals and tangents too.
void add_degenerate_triangles(Setting& s) {
  Mesh& mesh = s.scene.mesh;
  const auto first = static_cast<std::uint32_t>(mesh.positions.size());
  for (const double x : {-0.05, 0.0, 0.05}) {
    mesh.positions.emplace_back(x, 0.01, 0.02);
    mesh.normals.emplace_back(0, 0, 1);
    mesh.texture_coordinates.emplace_back(0.5, 0.5);
  }
  mesh.triangles.push_back({first, first, first});
  mesh.triangles.push_back({first, first, first + 1});
  mesh.triangles.push_back({first, first + 1, first + 2});
}

const Geometry kGeometries[] = {
    {"Usual", "plate", Seen::kPicture, [](Setting&) {}},
    {"UsualSphere", "sphere", Seen::kPicture, [](Setting&) {}},
    {"PlateThroughTheProjector",
     "plate",
     Seen::kAnything,
     [](Setting& s) { s.input.world_from_object.translation = projector_of(s); }},
    {"ProjectorInTheSphere",
     "sphere",
     Seen::kNothing,
     [](Setting& s) { s.input.world_from_object.translation = projector_of(s); }},
    {"BehindTheProjector",
     "sphere",
     Seen::kNothing,
     [](Setting& s) { s.input.world_from_object.translation = before_projector(s, -1); }},
    {"OneMillimetreBeforeTheProjector",
     "sphere",
     Seen::kAnything,
     [](Setting& s) { s.input.world_from_object.translation = before_projector(s, 0.101); }},
    {"AtTwoKilometres",
     "sphere",
     Seen::kAnything,
     [](Setting& s) { s.input.world_from_object.translation = before_projector(s, 2000); }},
    {"AtTwoKilometresThroughATelescope",
     "sphere",
     Seen::kOutOfReach,
     [](Setting& s) {
       field_of_view(s, 0.01);
       s.input.world_from_object.translation = before_projector(s, 2000);
     }},
    {"EverythingTwoKilometresAway",
     "sphere",
     Seen::kPicture,
     [](Setting& s) {
       const Vector3d far(2000, -300, 100);
       s.profile.geometry.world_from_projector.translation += far;
       s.input.world_from_object.translation = far;
       s.input.eye_in_world += far;
     }},
    {"FieldOfView0_1", "plate", Seen::kPicture, [](Setting& s) { field_of_view(s, 0.1); }},
    {"FieldOfView170", "plate", Seen::kAnything, [](Setting& s) { field_of_view(s, 170); }},
    {"FieldOfView170FromOneCentimetre",
     "plate",
     Seen::kPicture,
     [](Setting& s) {
       field_of_view(s, 170);
       s.input.world_from_object.rotation = s.profile.geometry.world_from_projector.rotation *
                                            Eigen::AngleAxisd(kPi, Vector3d::UnitX());
       s.input.world_from_object.translation = before_projector(s, 0.01);
       s.profile.reference_distance_m = 0.01;
     }},
    {"EyeOnTheSurface",
     "plate",
     Seen::kPicture,
     [](Setting& s) { s.input.eye_in_world.setZero(); }},
    {"EyeAtACorner",
     "plate",
     Seen::kPicture,
     [](Setting& s) { s.input.eye_in_world = s.scene.mesh.positions.front(); }},
    {"EyeInTheSphere",
     "sphere",
     Seen::kPicture,
     [](Setting& s) { s.input.eye_in_world.setZero(); }},
    {"EyeBehindThePlate",
     "plate",
     Seen::kPicture,
     [](Setting& s) {
       s.input.eye_in_world = {0.1, 0, -1};
     }},
    {"EyeAtTheProjector",
     "plate",
     Seen::kPicture,
     [](Setting& s) { s.input.eye_in_world = projector_of(s); }},
    {"EyeAtTwoKilometres",
     "plate",
     Seen::kPicture,
     [](Setting& s) {
       s.input.eye_in_world = {100, 0, 2000};
     }},
    {"LampOnTheSurface",
     "plate",
     Seen::kNoLight,
     [](Setting& s) {
       lamp_at(s, {0, 0, 0});
     }},
    {"LampAtACorner",
     "plate",
     Seen::kNoLight,
     [](Setting& s) { lamp_at(s, s.scene.mesh.positions.front()); }},
    {"LampInTheSphere",
     "sphere",
     Seen::kNoLight,
     [](Setting& s) {
       lamp_at(s, {0, 0, 0});
     }},
    {"LampBehindThePlate",
     "plate",
     Seen::kNoLight,
     [](Setting& s) {
       lamp_at(s, {0, 0, -0.2});
     }},
    {"LampAtTwoKilometres",
     "plate",
     Seen::kAnything,
     [](Setting& s) {
       lamp_at(s, {0, 0, 2000});
     }},
    {"NoLight", "plate", Seen::kNoLight, [](Setting& s) { sun_of(s, 0); }},
    {"DenormalLight", "plate", Seen::kNoLight, [](Setting& s) { sun_of(s, 1e-40); }},
    {"1e7Lux", "plate", Seen::kPicture, [](Setting& s) { sun_of(s, 1e7); }},
    {"1e30Lux", "plate", Seen::kPicture, [](Setting& s) { sun_of(s, 1e30); }},
    {"1e37Lux", "plate", Seen::kFault, [](Setting& s) { sun_of(s, 1e37); }},
    {"DegenerateTriangles", "plate", Seen::kPicture, &add_degenerate_triangles},
    {"NothingButDegenerateTriangles",
     "plate",
     Seen::kNothing,
     [](Setting& s) {
       s.scene.mesh.triangles.clear();
       add_degenerate_triangles(s);
     }},
    {"NoNormals",
     "plate",
     Seen::kNothing,
     [](Setting& s) { std::ranges::fill(s.scene.mesh.normals, Vector3d::Zero()); }},
    {"OneTextureCoordinate",
     "plate",
     Seen::kPicture,
     [](Setting& s) {
       std::ranges::fill(s.scene.mesh.texture_coordinates, Eigen::Vector2d(0.3, 0.3));
     }},
};

// The target is stored in half floats: one step of 2^-10 of each component.
constexpr double kHalfFloatTolerance = 2e-3;
constexpr double kHalfMax = 65504;
constexpr double kAlbedo = 0.5;

/// Lambert's luminance at most, and all over a plate; of a lamp no less than nothing.
double luminance_of(const Setting& setting, bool is_plate) {
  const auto* sun = std::get_if<DirectionalLight>(&setting.scene.lights[0]);
  if (sun == nullptr) return kHalfMax;
  const Vector3d normal = setting.input.world_from_object.rotation * Vector3d::UnitZ();
  const double cosine = is_plate ? std::max(normal.dot(sun->direction_to_light), 0.0) : 1.0;
  return std::min(kAlbedo * cosine * sun->illuminance_rgb.y() / kPi, kHalfMax);
}

class GeometryOnGl : public testing::TestWithParam<std::tuple<Geometry, Evaluation>> {};

TEST_P(GeometryOnGl, IsFiniteAndDarkRatherThanWhite) {
  if (const auto context = EglContext::create(); !context) GTEST_SKIP() << context.error().what;
  const auto& [geometry, evaluation] = GetParam();
  Setting setting;
  setting.scene.mesh = *load_mesh(geometry.mesh);
  sun_of(setting, kPi);
  geometry.change(setting);
  // Lambert, and the view as a material's lobe would take it: what is no number in either is seen.
  const ShaderMaterial material(
      "return light.z > 0.0 ? vec3(0.5 * light.z) + 0.0 * view : vec3(0.0);");
  auto renderer = Renderer::create(
      setting.scene, one_level(material, {.evaluation = evaluation}), setting.profile, {});
  ASSERT_TRUE(renderer) << renderer.error().what;
  Image<Rgb32f> target(kWidth, kHeight);
  Image<Rgb16> codes(kWidth, kHeight);
  (*renderer)->draw(setting.input);
  (*renderer)->read_target(target.view());
  (*renderer)->read_codes(codes.view());
  (*renderer)->finish();
  const std::uint64_t covered = (*renderer)->statistics().covered_pixels;

  const bool is_plate = std::string(geometry.mesh) == "plate";
  const bool is_sunny = std::holds_alternative<DirectionalLight>(setting.scene.lights[0]);
  const double luminance = luminance_of(setting, is_plate);
  std::size_t driven = 0;
  std::size_t lit = 0;
  for (int y = 0; y < kHeight; ++y)
    for (int x = 0; x < kWidth; ++x) {
      driven += codes(x, y) != Rgb16{} ? 1 : 0;
      if (geometry.seen == Seen::kFault && !target(x, y).allFinite()) {
        ASSERT_EQ(codes(x, y), Rgb16{}) << x << ", " << y;
        continue;
      }
      ASSERT_TRUE(target(x, y).allFinite()) << x << ", " << y;
      ASSERT_GE(target(x, y).minCoeff(), 0) << x << ", " << y;
      const double shown = target(x, y).y();
      lit += shown > 0 ? 1 : 0;
      ASSERT_LE(shown, luminance * (1 + kHalfFloatTolerance)) << x << ", " << y;
      if (is_plate && is_sunny && shown > 0) {
        ASSERT_GE(shown, luminance * (1 - kHalfFloatTolerance)) << x << ", " << y;
      }
    }
  switch (geometry.seen) {
    case Seen::kNothing:
      EXPECT_EQ(covered, 0U);
      EXPECT_EQ(driven, 0U);
      break;
    case Seen::kNoLight:
      EXPECT_GT(covered, 0U);
      EXPECT_EQ(lit, 0U);
      break;
    case Seen::kOutOfReach:
      EXPECT_GT(covered, 0U);
      EXPECT_EQ(driven, 0U);
      break;
    case Seen::kFault:
      EXPECT_GT(covered, 0U);
      EXPECT_EQ(lit, 0U);
      EXPECT_EQ(driven, 0U);
      break;
    case Seen::kPicture:
      EXPECT_GT(lit, 0U);
      EXPECT_GT(driven, 0U);
      break;
    case Seen::kAnything:
      break;
  }
}

INSTANTIATE_TEST_SUITE_P(All,
                         GeometryOnGl,
                         testing::Combine(testing::ValuesIn(kGeometries),
                                          testing::Values(Evaluation::kFragment,
                                                          Evaluation::kCompute)),
                         [](const auto& at) {
                           return std::string(std::get<0>(at.param).name) +
                                  (std::get<1>(at.param) == Evaluation::kFragment ? "_Fragment"
                                                                                  : "_Compute");
                         });

}  // namespace
}  // namespace veneer::render
