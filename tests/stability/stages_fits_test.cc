// SPDX-License-Identifier: Apache-2.0
// Colour models fitted on readings from which none should be made, and on extreme ones from which
// one must be: each is refused with a text, or is a model that is finite everywhere and makes a
// profile. With invalid operations and divisions by zero trapped.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "base/testing/fp_trap.h"
#include "calibration/colour/baking.h"
#include "calibration/colour/internal_testing.h"
#include "calibration/colour/inverse.h"

namespace veneer::calibration {
namespace {

using Eigen::Vector3d;

void replace_light(ExampleReadings& readings, Vector3d (*light_of_drive)(const Vector3d&)) {
  const LadderProjector projector({});
  const auto curve = [](double t) { return std::sqrt(t); };  // half of the projector's own bend
  for (PatchReading& patch : readings.patches)
    patch.xyz = projector.light(light_of_drive(patch.drive).unaryExpr(curve));
  readings.black = mean_black(readings.patches);
}

/// Which families find a model.
enum class Fits {
  kNone,
  kAll,
  kAllButCubes,  ///< lut3d: two of its levels are the same light
  kFromRamps     ///< only who needs no mixtures of many different lights
};
bool fits(Fits which, const std::string& family) {
  switch (which) {
    case Fits::kNone:
      return false;
    case Fits::kAll:
      return true;
    case Fits::kAllButCubes:
      return family != "lut3d";
    case Fits::kFromRamps:
      return family != "lut3d" && family != "interaction" && family != "white-segment";
  }
  return false;
}
struct Readings {
  const char* name;
  Fits fits;
  void (*change)(ExampleReadings&);
};

const Readings kReadings[] = {
    {"Usual", Fits::kAll, [](ExampleReadings&) {}},
    {"EveryPatchTwice",
     Fits::kAll,
     [](ExampleReadings& r) {
       const std::vector<PatchReading> once = r.patches;
       r.patches.insert(r.patches.end(), once.begin(), once.end());
     }},
    {"AMillionTimesAsBright",
     Fits::kAll,
     [](ExampleReadings& r) {
       for (PatchReading& patch : r.patches) patch.xyz *= 1e6;
       r.black *= 1e6;
     }},
    {"AMillionTimesAsDark",
     Fits::kAll,
     [](ExampleReadings& r) {
       for (PatchReading& patch : r.patches) patch.xyz *= 1e-6;
       r.black *= 1e-6;
     }},
    {"ContrastOfAMillion",
     Fits::kAll,
     [](ExampleReadings& r) {
       const Xyz white = LadderProjector({}).white();
       for (PatchReading& patch : r.patches) patch.xyz += 1e-6 * white - r.black;
       r.black = 1e-6 * white;
     }},
    {"FlatBelowHalf",
     Fits::kAllButCubes,
     [](ExampleReadings& r) {
       replace_light(r, [](const Vector3d& d) -> Vector3d {
         return (2 * d - Vector3d::Ones()).cwiseMax(0.0);
       });
     }},
    {"FlatAboveHalf",
     Fits::kAllButCubes,
     [](ExampleReadings& r) {
       replace_light(r, [](const Vector3d& d) -> Vector3d { return (2 * d).cwiseMin(1.0); });
     }},
    {"OneStep",
     Fits::kFromRamps,
     [](ExampleReadings& r) {
       replace_light(r, [](const Vector3d& d) -> Vector3d {
         return d.unaryExpr([](double x) { return x < 0.5 ? 0.0 : 1.0; });
       });
     }},
    {"FallingAboveHalf",
     Fits::kNone,
     [](ExampleReadings& r) {
       replace_light(r, [](const Vector3d& d) -> Vector3d {
         return d.unaryExpr([](double x) { return x < 0.5 ? 2 * x : 1.5 - x; });
       });
     }},
    {"AllEqual",
     Fits::kNone,
     [](ExampleReadings& r) {
       for (PatchReading& patch : r.patches) patch.xyz = r.black;
     }},
    {"AllGrey",
     Fits::kNone,
     [](ExampleReadings& r) {
       for (PatchReading& patch : r.patches) patch.xyz = patch.xyz.y() * Xyz(0.95, 1, 1.09);
       r.black = mean_black(r.patches);
     }},
    {"BlueBetweenRedAndGreen",
     Fits::kNone,
     [](ExampleReadings& r) {
       const LadderProjector projector({});
       for (PatchReading& patch : r.patches) {
         const Vector3d& d = patch.drive;
         patch.xyz = projector.light({d.x(), d.y(), 0}) + projector.light({d.z(), d.z(), 0}) -
                     projector.black();
       }
     }},
    {"OnePatch", Fits::kNone, [](ExampleReadings& r) { r.patches.resize(1); }},
    {"NoPatch", Fits::kNone, [](ExampleReadings& r) { r.patches.clear(); }},
    {"BlackAlone",
     Fits::kNone,
     [](ExampleReadings& r) {
       std::erase_if(r.patches, [](const PatchReading& patch) { return !patch.drive.isZero(0); });
     }},
    {"BlackAboveWhite", Fits::kNone, [](ExampleReadings& r) { r.black = Xyz(1e3, 1e3, 1e3); }},
    {"OneReadingNoNumber",
     Fits::kNone,
     [](ExampleReadings& r) { r.patches[17].xyz.y() = std::nan(""); }},
    {"OneReadingInfinite",
     Fits::kNone,
     [](ExampleReadings& r) { r.patches[17].xyz.x() = HUGE_VAL; }},
};

std::vector<std::string> names_of_families() {
  std::vector<std::string> names;
  for (const ColourModelFamily& family : colour_model_families()) names.emplace_back(family.name);
  return names;
}

class FitsAtExtremes : public testing::TestWithParam<std::tuple<std::string, Readings>> {};

TEST_P(FitsAtExtremes, AreRefusedOrFiniteAndMakeAProfile) {
  const auto& [name, readings] = GetParam();
  const auto family =
      *std::ranges::find(colour_model_families(), name, [](const ColourModelFamily& f) {
        return std::string(f.name);
      });
  ExampleReadings given = example_readings({});
  readings.change(given);
  const bool is_number = std::ranges::all_of(
      given.patches, [](const PatchReading& patch) { return patch.xyz.allFinite(); });
  const FpTrap trap;
  const auto model = [&] {
    if (is_number) return family.fit(given.patches, given.black);
    const FpPause pause;
    return family.fit(given.patches, given.black);
  }();
  ASSERT_EQ(model.has_value(), fits(readings.fits, name)) << (model ? "" : model.error().what);
  if (!model) {
    EXPECT_FALSE(model.error().what.empty());
    return;
  }
  const Xyz white = (*model)->forward(Vector3d::Ones());
  for (const double r : {-1.0, 0.0, 1e-310, 0.5, 1.0, 2.0})
    for (const double g : {0.0, 0.5, 1.0})
      for (const double b : {0.0, 1e-6, 1.0}) {
        const Vector3d drive(r, g, b);
        ASSERT_TRUE((*model)->forward(drive).allFinite()) << drive.transpose();
        ASSERT_TRUE((*model)->jacobian(drive).allFinite()) << drive.transpose();
      }
  ASSERT_GT(white.minCoeff(), 0);
  const auto baked = bake(**model, 8);
  ASSERT_TRUE(baked) << baked.error().what;
  for (const auto& curve : baked->tone_curves) {
    EXPECT_TRUE(std::ranges::is_sorted(curve));
    EXPECT_EQ(curve.front(), 0);
    EXPECT_EQ(curve.back(), 1);
  }
  EXPECT_TRUE(baked->primaries.allFinite());
  // From white, which is in reach, and from what is not; nothing but a drive of the cube.
  const auto inverse = ColourInverse::make(**model, given.black);
  ASSERT_TRUE(inverse) << inverse.error().what;
  for (const double part : {-1.0, 0.0, 1e-300, 1.0, 1e6}) {
    const InverseColour found = (*inverse)(part * white);
    ASSERT_TRUE(found.drive.allFinite()) << part;
    EXPECT_GE(found.drive.minCoeff(), 0) << part;
    EXPECT_LE(found.drive.maxCoeff(), 1) << part;
    EXPECT_TRUE(std::isfinite(found.gamut_loss)) << part;
    if (part == 1) {
      EXPECT_LT(found.residual, 1e-3);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(All,
                         FitsAtExtremes,
                         testing::Combine(testing::ValuesIn(names_of_families()),
                                          testing::ValuesIn(kReadings)),
                         [](const auto& at) {
                           std::string name =
                               std::get<0>(at.param) + "_" + std::get<1>(at.param).name;
                           std::ranges::replace(name, '-', '_');
                           return name;
                         });

}  // namespace
}  // namespace veneer::calibration
