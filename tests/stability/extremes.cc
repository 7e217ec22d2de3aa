// SPDX-License-Identifier: Apache-2.0
#include "tests/stability/extremes.h"

#include <Eigen/Geometry>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <type_traits>

#include "base/random.h"
#include "btf/models/components.h"
#include "tests/stability/subjects.h"

namespace veneer::stability {
namespace {

using btf::Direction;
using btf::DirectionSet;
using btf::FitOptions;
using btf::SampleSetInfo;

constexpr double kDegree = std::numbers::pi / 180.0;

double black(const SampleSetInfo&, int, int, int, int) { return 0.0; }
double matte(const SampleSetInfo& info, int texel, int, int light, int channel) {
  return lambert(info, texel, light, channel);
}
double alike(const SampleSetInfo& info, int, int, int light, int channel) {
  return lambert(info, 0, light, channel);
}
double constant(const SampleSetInfo&, int, int, int, int) { return 0.5; }
double red(const SampleSetInfo& info, int texel, int, int light, int channel) {
  return channel == 0 ? lambert(info, texel, light, 0) : 0.0;
}
double negative(const SampleSetInfo& info, int texel, int, int light, int channel) {
  return -lambert(info, texel, light, channel);
}
double noise(const SampleSetInfo& info, int texel, int view, int light, int channel) {
  const int pair = view * static_cast<int>(info.lights.size()) + light;
  return Pcg32(static_cast<std::uint64_t>(pair * 3 + channel), static_cast<std::uint64_t>(texel))
      .uniform();
}
double signed_noise(const SampleSetInfo& info, int texel, int view, int light, int channel) {
  return 2.0 * noise(info, texel, view, light, channel) - 1.0;
}
double impulse(const SampleSetInfo&, int texel, int view, int light, int channel) {
  return texel == 5 && view == 3 && light == 2 && channel == 1 ? 1000.0 : 0.0;
}
double with_value(double value, const SampleSetInfo& info, int texel, int view, int light, int c) {
  return texel == 5 && view == 3 && light == 2 ? value : matte(info, texel, view, light, c);
}
double not_a_number(const SampleSetInfo& info, int texel, int view, int light, int channel) {
  return with_value(std::nan(""), info, texel, view, light, channel);
}
double infinite(const SampleSetInfo& info, int texel, int view, int light, int channel) {
  return with_value(HUGE_VAL, info, texel, view, light, channel);
}
double minus_infinite(const SampleSetInfo& info, int texel, int view, int light, int channel) {
  return with_value(-HUGE_VAL, info, texel, view, light, channel);
}
// Of texels: 1 to 1e-6 of the brightest.
double range_of_texels(const SampleSetInfo& info, int texel, int, int light, int channel) {
  return 100.0 * std::pow(10.0, -6.0 * texel / 11.0) * lambert(info, 0, light, channel);
}
// Of pairs.
double range_of_pairs(const SampleSetInfo& info, int texel, int view, int light, int channel) {
  const auto spread = static_cast<double>(info.views.size() + info.lights.size() - 2);
  return 100.0 * std::pow(10.0, -6.0 * (view + light) / std::max(spread, 1.0)) *
         colour(texel, channel);
}
double denormal(const SampleSetInfo& info, int texel, int, int light, int channel) {
  return 6e-5 * lambert(info, texel, light, channel);
}
double least_denormal(const SampleSetInfo&, int texel, int, int, int) {
  return texel % 2 == 0 ? 0x1p-24 : 0.0;
}
double largest(const SampleSetInfo& info, int texel, int, int light, int channel) {
  return 65504.0 / 0.9 * lambert(info, texel, light, channel);
}

void one_texel(SampleSetInfo& info) { info.width = info.height = 1; }
void one_view(SampleSetInfo& info) { info.views = {Direction::UnitZ()}; }
void one_slanting_view(SampleSetInfo& info) {
  info.views = {btf::direction_from_angles({75 * kDegree, 0.7})};
}
void one_light(SampleSetInfo& info) { info.lights = {Direction::UnitZ()}; }
void one_slanting_light(SampleSetInfo& info) {
  info.lights = {btf::direction_from_angles({75 * kDegree, 4.0})};
}
void one_of_each(SampleSetInfo& info) {
  one_texel(info);
  one_view(info);
  one_slanting_light(info);
}
DirectionSet horizon() {
  DirectionSet all = btf::testing::ring(7, 90 * kDegree);
  all.erase(all.begin());
  for (Direction& direction : all) direction.z() = 0.0;
  return all;
}
void lights_on_horizon(SampleSetInfo& info) { info.lights = horizon(); }
void views_on_horizon(SampleSetInfo& info) { info.views = horizon(); }
void one_plane(SampleSetInfo& info) {
  info.views.clear();
  for (const double theta : {-70.0, -30.0, 0.0, 20.0, 60.0})
    info.views.push_back(btf::direction_from_angles({theta * kDegree, 0.4}));
  info.lights = info.views;
}
void ring_alone(SampleSetInfo& info) {
  info.views.erase(info.views.begin());
  info.lights.erase(info.lights.begin());
}
// Twice kEqualDirections apart, which is as near as a set allows.
void nearly_equal(SampleSetInfo& info) {
  for (DirectionSet* set : {&info.views, &info.lights})
    set->push_back((set->at(4) + 2e-6 * Direction::UnitZ().cross(set->at(4))).normalized());
}
void one_row(SampleSetInfo& info) {
  info.width = 12;
  info.height = 1;
}
void tiny_scale(SampleSetInfo& info) { info.scale = btf::kLeastScale; }
void huge_scale(SampleSetInfo& info) { info.scale = btf::kMostScale; }

void components(FitOptions& options, int terms, int each) {
  options.components = terms == 2 ? fmt::format("{0}+{0}", each) : fmt::format("{}", each);
}
void one_component(FitOptions& options, int terms) { components(options, terms, 1); }
void most_components(FitOptions& options, int terms) {
  components(options, terms, btf::kMostComponents);
}
void too_many_components(FitOptions& options, int terms) {
  components(options, terms, btf::kMostComponents + 1);
}
void clusters_of(FitOptions& options, int clusters) { options.clusters = clusters; }

}  // namespace

void PrintTo(const Extreme& extreme, std::ostream* out) { *out << extreme.name; }

std::vector<Extreme> extremes() {
  const auto clusters = []<int count>(std::integral_constant<int, count>) {
    return +[](FitOptions& options, int) { clusters_of(options, count); };
  };
  const auto angular = []<int nodes>(std::integral_constant<int, nodes>) {
    return +[](FitOptions& options, int) { options.angular = nodes; };
  };
  const auto as_it_is = +[](SampleSetInfo&) {};
  return {
      // Data.
      {.name = "AllZero", .must = Must::kBeZero, .sample = &black},
      {.name = "Constant", .must = Must::kHold, .sample = &constant, .components_hold = true},
      {.name = "TexelsAlike", .must = Must::kHold, .sample = &alike},
      {.name = "OneChannel", .must = Must::kHold, .sample = &red},
      {.name = "FullRankNoise", .must = Must::kBound, .sample = &noise},
      {.name = "NoiseOfBothSigns", .must = Must::kBound, .sample = &signed_noise},
      {.name = "AllNegative", .must = Must::kBeZero, .sample = &negative},
      {.name = "OneBrightSample", .must = Must::kBound, .sample = &impulse},
      {.name = "TexelsOverSixDecades",
       .must = Must::kHold,
       .sample = &range_of_texels,
       .more_error = 0x1p-10},
      {.name = "PairsOverSixDecades", .must = Must::kBound, .sample = &range_of_pairs},
      {.name = "HalfDenormals", .must = Must::kHold, .sample = &denormal, .more_error = 0x1p-10},
      {.name = "LeastHalfDenormal",
       .must = Must::kHold,
       .sample = &least_denormal,
       .components_hold = true},
      {.name = "LargestHalf", .must = Must::kHold, .sample = &largest},
      {.name = "TinyScale", .must = Must::kHold, .sample = &matte, .shape = &tiny_scale},
      {.name = "HugeScale", .must = Must::kHold, .sample = &matte, .shape = &huge_scale},
      {.name = "NanSample",
       .must = Must::kRefuse,
       .sample = &not_a_number,
       .words = {"NaN or infinite", "texel 5", "row 1", "column 1", "view 3", "light 2", "repair"}},
      {.name = "InfiniteSample",
       .must = Must::kRefuse,
       .sample = &infinite,
       .words = {"NaN or infinite", "texel 5", "view 3", "light 2"}},
      {.name = "MinusInfiniteSample",
       .must = Must::kRefuse,
       .sample = &minus_infinite,
       .words = {"NaN or infinite", "texel 5", "view 3", "light 2"}},
      // Sizes.
      {.name = "OneTexel", .must = Must::kHold, .sample = &matte, .shape = &one_texel},
      {.name = "OneRow", .must = Must::kHold, .sample = &matte, .shape = &one_row},
      {.name = "OneView", .must = Must::kHold, .sample = &matte, .shape = &one_view},
      {.name = "OneSlantingView",
       .must = Must::kHold,
       .sample = &matte,
       .shape = &one_slanting_view},
      {.name = "OneLight", .must = Must::kHold, .sample = &matte, .shape = &one_light},
      {.name = "OneSlantingLight",
       .must = Must::kHold,
       .sample = &matte,
       .shape = &one_slanting_light},
      {.name = "OneOfEach", .must = Must::kHold, .sample = &matte, .shape = &one_of_each},
      // Directions.
      {.name = "LightsOnHorizon",
       .must = Must::kBeZero,
       .sample = &matte,
       .shape = &lights_on_horizon},
      {.name = "ViewsOnHorizon", .must = Must::kHold, .sample = &matte, .shape = &views_on_horizon},
      {.name = "DirectionsInOnePlane", .must = Must::kHold, .sample = &matte, .shape = &one_plane},
      {.name = "NoDirectionAtThePole", .must = Must::kHold, .sample = &matte, .shape = &ring_alone},
      {.name = "DirectionsNearlyEqual",
       .must = Must::kHold,
       .sample = &matte,
       .shape = &nearly_equal},
      // Options.
      {.name = "OneCluster",
       .must = Must::kHold,
       .sample = &matte,
       .choose = clusters(std::integral_constant<int, 1>())},
      {.name = "MoreClustersThanTexels",
       .must = Must::kHold,
       .sample = &matte,
       .choose = clusters(std::integral_constant<int, 256>())},
      {.name = "NoCluster",
       .must = Must::kRefuse,
       .sample = &matte,
       .choose = clusters(std::integral_constant<int, 0>()),
       .words = {"clusters is 0", "1 to 256"}},
      {.name = "OneComponent",
       .must = Must::kHold,
       .sample = &alike,
       .shape = as_it_is,
       .choose = &one_component},
      {.name = "MostComponentsOfRankOne",
       .must = Must::kHold,
       .sample = &alike,
       .shape = as_it_is,
       .choose = &most_components},
      {.name = "TooManyComponents",
       .must = Must::kRefuse,
       .sample = &matte,
       .choose = &too_many_components,
       .words = {"components", "1 to 16"}},
      {.name = "CoarsestGrid",
       .must = Must::kBound,
       .sample = &matte,
       .choose = angular(std::integral_constant<int, FitOptions::kLeastAngular>())},
      {.name = "FinestGrid",
       .must = Must::kHold,
       .sample = &matte,
       .choose = angular(std::integral_constant<int, FitOptions::kMostAngular>())},
      {.name = "GridTooCoarse",
       .must = Must::kRefuse,
       .sample = &matte,
       .choose = angular(std::integral_constant<int, FitOptions::kLeastAngular - 1>()),
       .words = {"angular is 3", "4 to 32"}},
      {.name = "GridTooFine",
       .must = Must::kRefuse,
       .sample = &matte,
       .choose = angular(std::integral_constant<int, FitOptions::kMostAngular + 1>()),
       .words = {"angular is 33", "4 to 32"}},
      {.name = "MostLobes",
       .must = Must::kHold,
       .sample = &matte,
       .choose = [](FitOptions& options, int) { options.lobes = FitOptions::kMostLobes; }},
      {.name = "NoLobe",
       .must = Must::kRefuse,
       .sample = &matte,
       .choose = [](FitOptions& options, int) { options.lobes = 0; },
       .words = {"lobes is 0", "1 to 4"}},
      {.name = "FullSpaceAndOneIteration",
       .must = Must::kHold,
       .sample = &matte,
       .choose =
           [](FitOptions& options, int) {
             options.basis = 0;
             options.iterations = 1;
           }},
      {.name = "MipLevelOfOneTexel",
       .must = Must::kRefuse,
       .sample = &alike,
       .shape = [](SampleSetInfo& info) { info.width = info.height = 2; },
       .choose = [](FitOptions& options, int) { options.mip_levels = 2; },
       .words = {"mip_levels is 2", "leave it out"},
       .for_texel_colours = true},
      {.name = "UnknownPrecision",
       .must = Must::kRefuse,
       .sample = &matte,
       .choose = [](FitOptions& options, int) { options.precision = "float64"; },
       .words = {"precision is \"float64\""}},
  };
}

bool has_own_hues(const Extreme& extreme) {
  const auto sample = extreme.sample;
  return sample == &matte || sample == &negative || sample == &denormal || sample == &largest;
}

}  // namespace veneer::stability
