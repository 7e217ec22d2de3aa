// SPDX-License-Identifier: Apache-2.0
#include "render/scene.h"

#include <gtest/gtest.h>

#include <fstream>
#include <numbers>
#include <string>

#include "base/testing/temporary_folder.h"

namespace veneer::render {
namespace {

using Eigen::Vector3d;

constexpr char kLight[] = "[[light]]\ndirection = [0, 0, 2]\nilluminance_lux = 300\n";

class SceneTest : public ::testing::Test {
 protected:
  Result<Scene> load(const std::string& text) {
    const auto path = folder_.path() / "scene.toml";
    std::ofstream(path) << text;
    return Scene::load(path);
  }
  // The text must be refused, with all of `words` in the message.
  void expect_refused(const std::string& text, const std::vector<std::string>& words) {
    const auto scene = load(text);
    ASSERT_FALSE(scene) << text;
    EXPECT_EQ(scene.error().code, Errc::kInvalidOption) << scene.error().what;
    for (const std::string& word : words)
      EXPECT_NE(scene.error().what.find(word), std::string::npos)
          << word << " in: " << scene.error().what;
  }
  TemporaryFolder folder_;
};

TEST_F(SceneTest, ReadsEveryKey) {
  const auto scene = load(R"(
mesh = "plate"
texture_repeats = [6.0, 3.0]
[object]
position = [1, 2, 3]
rotation_deg = [90, 90, 0]
tracker_body = 2
[observer]
tracker_body = 1
eye_in_sensor = [0.01, 0.02, 0.03]
[observer.region]
centre = [0, 1, 0]
radius_m = [0.5, 2]
azimuth_deg = [-90, 180]
elevation_deg = [-30, 90]
[[light]]
kind = "directional"
direction = [0, 0, 2]
illuminance_lux = 300
colour = [1, 0.5, 0]
[[light]]
kind = "point"
position = [0, 1, 0]
intensity_cd = 10
[light.region]
radius_m = [3, 3]
)");
  ASSERT_TRUE(scene) << scene.error().what;
  EXPECT_EQ(scene->texture_repeats, Eigen::Vector2d(6, 3));
  EXPECT_EQ(scene->object_body, 2);
  EXPECT_EQ(scene->observer_bodies, std::vector{1});
  EXPECT_EQ(scene->eye_in_sensor, Vector3d(0.01, 0.02, 0.03));
  // About x first: y becomes z. Then about y: z becomes x.
  const Vector3d moved = scene->world_from_object * Vector3d::UnitY();
  EXPECT_LT((moved - (Vector3d(1, 2, 3) + Vector3d::UnitX())).norm(), 1e-12) << moved.transpose();
  ASSERT_EQ(scene->lights.size(), 2U);
  const auto& sun = std::get<DirectionalLight>(scene->lights[0]);
  EXPECT_EQ(sun.direction_to_light, Vector3d::UnitZ());
  EXPECT_EQ(sun.illuminance_rgb, Vector3d(300, 150, 0));
  const auto& lamp = std::get<PointLight>(scene->lights[1]);
  EXPECT_EQ(lamp.position, Vector3d::UnitY());
  EXPECT_EQ(lamp.intensity_rgb, Vector3d(10, 10, 10));
  EXPECT_FALSE(scene->mesh.triangles.empty());
}

TEST_F(SceneTest, NeedsOnlyMeshAndOneLight) {
  const auto scene = load(std::string("mesh = \"sphere\"\n") + kLight);
  ASSERT_TRUE(scene) << scene.error().what;
  EXPECT_EQ(scene->object_body, -1);
  EXPECT_EQ(scene->observer_bodies, std::vector{0});
}

TEST_F(SceneTest, RefusesWhatItDoesNotKnow) {
  const std::string plate = "mesh = \"plate\"\n";
  expect_refused(plate + "texture_repeat = [1, 1]\n" + kLight,
                 {"texture_repeat", "texture_repeats"});
  expect_refused(plate, {"light"});
  expect_refused(plate + kLight + kLight + kLight + kLight + kLight, {"light", "4"});
  expect_refused(kLight, {"mesh"});
  expect_refused(plate + "[[light]]\nkind = \"spot\"\n", {"kind", "directional"});
  expect_refused(plate + "[[light]]\nkind = \"point\"\ndirection = [0, 0, 1]\nintensity_cd = 1\n",
                 {"direction", "position"});
  expect_refused(plate + "[[light]]\ndirection = [0, 0, 0]\nilluminance_lux = 1\n", {"direction"});
  expect_refused(plate + "[[light]]\ndirection = [0, 0, 1]\nilluminance_lux = -1\n",
                 {"illuminance_lux"});
  expect_refused(plate + "[[light]]\ndirection = [0, 0, 1]\nilluminance_lux = nan\n",
                 {"illuminance_lux"});
  expect_refused(plate + kLight + "colour = [1, -1, 0]\n", {"colour"});
  expect_refused(plate + "texture_repeats = [0, 1]\n" + kLight, {"texture_repeats"});
  expect_refused(plate + "[observer]\ntracker_body = -1\n" + kLight, {"tracker_body"});
  expect_refused(plate + "[object]\ntracker_body = -2\n" + kLight, {"tracker_body"});
}

TEST_F(SceneTest, WhatThePictureCannotHoldIsRefused) {
  const std::string plate = "mesh = \"plate\"\n";
  const std::string sun = plate + "[[light]]\ndirection = [0, 0, 1]\nilluminance_lux = ";
  const std::string lamp = plate + "[[light]]\nkind = \"point\"\nposition = ";
  // The amount and the colour are each in range; what counts is their product.
  EXPECT_TRUE(load(sun + "1e7\ncolour = [1, 1, 1]\n"));
  EXPECT_TRUE(load(sun + "1e6\ncolour = [10, 1, 1]\n"));
  expect_refused(sun + "1e7\ncolour = [1, 1.001, 1]\n", {"colour", "1e7"});
  expect_refused(sun + "1\ncolour = [1e308, 1, 1]\n", {"colour", "1e7"});
  expect_refused(lamp + "[0, 0, 1]\nintensity_cd = 1e7\ncolour = [2, 0, 0]\n", {"colour", "1e7"});
  // Nor what single precision cannot.
  EXPECT_TRUE(load(lamp + "[1000, -1000, 0]\nintensity_cd = 1\n"));
  expect_refused(lamp + "[1000.1, 0, 0]\nintensity_cd = 1\n", {"position", "1000"});
  expect_refused(plate + "[object]\nposition = [0, 0, -1e300]\n" + kLight, {"position", "1000"});
  expect_refused(plate + "[observer]\neye_in_sensor = [0, 1e39, 0]\n" + kLight,
                 {"eye_in_sensor", "1000"});
}

TEST_F(SceneTest, OneEyeOrTheMiddleOfTwo) {
  const std::string plate = "mesh = \"plate\"\n[observer]\n";
  const std::string left = "left_eye_in_sensor = [-0.03, 0.01, 0]\n";
  const std::string right = "right_eye_in_sensor = [0.04, 0.03, 0.02]\n";
  const auto eye_of = [&](const std::string& keys) {
    const auto scene = load(plate + keys + kLight);
    EXPECT_TRUE(scene) << scene.error().what;
    return scene ? scene->eye_in_sensor : Vector3d(9, 9, 9);
  };
  EXPECT_EQ(eye_of("eye = \"left\"\n" + left + right), Vector3d(-0.03, 0.01, 0));
  EXPECT_EQ(eye_of("eye = \"right\"\n" + left + right), Vector3d(0.04, 0.03, 0.02));
  EXPECT_LT((eye_of("eye = \"midpoint\"\n" + left + right) - Vector3d(0.005, 0.02, 0.01)).norm(),
            1e-15);
  EXPECT_EQ(eye_of("eye = \"left\"\n" + left), Vector3d(-0.03, 0.01, 0)) << "needs no other";
  EXPECT_EQ(eye_of("eye_in_sensor = [1, 2, 3]\n"), Vector3d(1, 2, 3));
  EXPECT_EQ(eye_of(""), Vector3d(0, 0, 0));

  const std::string one = "eye_in_sensor = [0, 0, 0]\n";
  expect_refused(plate + "eye = \"middle\"\n" + left + right + kLight, {"eye", "midpoint"});
  expect_refused(plate + "eye = \"midpoint\"\n" + left + kLight,
                 {"right_eye_in_sensor", "missing"});
  expect_refused(plate + "eye = \"left\"\n" + right + kLight, {"left_eye_in_sensor", "missing"});
  expect_refused(plate + "eye = \"left\"\n" + left + one + kLight, {"eye_in_sensor", "remove"});
  expect_refused(plate + "eye = \"left\"\n" + one + kLight, {"left_eye_in_sensor", "missing"});
  expect_refused(plate + left + kLight, {"which eye", "midpoint"});
  expect_refused(plate + one + right + kLight, {"which eye"});
  expect_refused(plate + "eye = \"right\"\nright_eye_in_sensor = [0, nan, 0]\n" + kLight,
                 {"right_eye_in_sensor", "finite"});
}

TEST_F(SceneTest, SaysThatTheMeshIsMissing) {
  const auto scene = load(std::string("mesh = \"teapot.obj\"\n") + kLight);
  ASSERT_FALSE(scene);
  EXPECT_EQ(scene.error().code, Errc::kNotFound);
  EXPECT_NE(scene.error().what.find("teapot.obj"), std::string::npos);
  EXPECT_EQ(Scene::load(folder_.path() / "no.toml").error().code, Errc::kNotFound);
}

TEST_F(SceneTest, RegionsAreThickSpheresParts) {
  const Region region{{0, 1, 0},
                      {0.5, 2.0},
                      {-std::numbers::pi / 2, std::numbers::pi},
                      {-std::numbers::pi / 6, std::numbers::pi / 2}};
  const auto scene =
      load(std::string("mesh = \"plate\"\n[observer.region]\ncentre = [0, 1, 0]\n") +
           "radius_m = [0.5, 2]\nazimuth_deg = [-90, 180]\nelevation_deg = [-30, 90]\n" + kLight +
           kLight + "[light.region]\nradius_m = [3, 3]\n");
  ASSERT_TRUE(scene) << scene.error().what;
  ASSERT_TRUE(scene->observer_region);
  constexpr double kRounding = 1e-12;
  for (const Vector3d& at : {Vector3d(0, 0, 0), Vector3d(1, 1, 1), Vector3d(0.3, 0.5, 0.7)})
    EXPECT_LE((point_in(*scene->observer_region, at) - point_in(region, at)).norm(), kRounding);
  ASSERT_EQ(scene->light_regions.size(), 2U);
  EXPECT_FALSE(scene->light_regions[0]);
  EXPECT_TRUE(scene->light_regions[1]);
  // The ends: -90 degrees is -x, elevation 90 degrees is +y.
  EXPECT_LE((point_in(region, {0, 0, 0}) -
             Vector3d(-0.5 * std::cos(std::numbers::pi / 6), 1.0 - 0.25, 0.0))
                .norm(),
            kRounding);
  EXPECT_LE((point_in(region, {0.5, 1, 1}) - Vector3d(0, 3, 0)).norm(), kRounding);
}

TEST_F(SceneTest, RefusesRegionsThatAreNone) {
  const std::string scene = std::string("mesh = \"plate\"\n") + "[observer.region]\n";
  const std::string light = kLight;
  expect_refused(scene + "radius_m = [2, 1]\n" + light, {"radius_m", "ascending"});
  expect_refused(scene + "radius_m = [0, 1]\n" + light, {"radius_m", "above 0"});
  expect_refused(scene + "azimuth_deg = [-200, 200]\n" + light, {"azimuth_deg", "apart"});
  expect_refused(scene + "elevation_deg = [0, 91]\n" + light, {"elevation_deg", "90"});
  expect_refused(scene + "elevation_deg = [nan, 1]\n" + light, {"elevation_deg"});
  expect_refused(scene + "centre = [0, 0, inf]\n" + light, {"centre"});
  expect_refused(scene + "azimuth = [0, 1]\n" + light, {"azimuth", "azimuth_deg"});
}

}  // namespace
}  // namespace veneer::render
