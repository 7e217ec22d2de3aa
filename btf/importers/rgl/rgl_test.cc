// SPDX-License-Identifier: Apache-2.0
#include "btf/importers/rgl/rgl.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <numbers>

#include "btf/importers/internal_test_files.h"

namespace veneer::btf {
namespace {

constexpr double kPi = std::numbers::pi;

// f_r; any azimuths.
using Law = std::function<double(const Direction& view, const Direction& light)>;

struct Tensor {
  std::string name;
  std::vector<std::uint64_t> shape;
  std::vector<float> values;
};

std::string tensor_file(const std::vector<Tensor>& tensors) {
  std::string bytes("tensor_file\0\1\0", 14);
  testing::put(bytes, static_cast<std::uint32_t>(tensors.size()));
  std::size_t offset = bytes.size();
  for (const Tensor& t : tensors) offset += 2 + t.name.size() + 2 + 1 + 8 + 8 * t.shape.size();
  for (const Tensor& t : tensors) {
    testing::put(bytes, static_cast<std::uint16_t>(t.name.size()));
    bytes += t.name;
    testing::put(bytes, static_cast<std::uint16_t>(t.shape.size()));
    testing::put(bytes, std::uint8_t{10});
    testing::put(bytes, static_cast<std::uint64_t>(offset));
    for (const std::uint64_t extent : t.shape) testing::put(bytes, extent);
    offset += 4 * t.values.size();
  }
  for (const Tensor& t : tensors)
    for (const float value : t.values) testing::put(bytes, value);
  return bytes;
}

// How a file is made: the grids' sides, azimuths of the view over a turn (1 for an isotropic file)
// and its angles to the normal, to 90 degrees.
struct Grid {
  int side = 65;
  int azimuths = 1;
  int angles = 13;  // every 7.5 degrees: those of the Bonn views are among them
};

// vndf is a product of two linear densities, 1 + a (2 x - 1) along theta_m and 1 + b (2 y - 1)
// along phi_m, so that bilinear grids hold it exactly and its distribution inverts in closed form.
// `a` is linear in theta_i, as are mixtures of slices. This solves x (1 - a) + a x^2 = s.
double inverted(double a, double s) {
  return std::abs(a) < 1e-9
             ? s
             : (a - 1.0 + std::sqrt((1.0 - a) * (1.0 - a) + 4.0 * a * s)) / (2.0 * a);
}

// ndf and sigma are no physical ones: whatever they are, what the file says is their product with
// rgb, which is the law's.
double ndf_at(double u) { return 0.5 + u; }
double sigma_at(double u) { return 1.0 - 0.4 * u; }

std::string rgl_file(const Law& law, const Grid& grid) {
  const auto n = static_cast<std::size_t>(grid.side);
  std::vector<Tensor> tensors{
      {"theta_i", {std::uint64_t(grid.angles)}, {}},
      {"phi_i", {std::uint64_t(grid.azimuths)}, {}},
      {"ndf", {2, n}, {}},
      {"sigma", {2, n}, {}},
      {"vndf", {std::uint64_t(grid.azimuths), std::uint64_t(grid.angles), n, n}, {}},
      {"rgb", {std::uint64_t(grid.azimuths), std::uint64_t(grid.angles), 3, n, n}, {}}};
  const auto values = [&](std::size_t i) -> std::vector<float>& { return tensors[i].values; };
  const auto node = [&](std::size_t i) { return double(i) / double(n - 1); };
  for (std::size_t i = 0; i < 2 * n; ++i) {
    values(2).push_back(float(ndf_at(node(i % n))));
    values(3).push_back(float(sigma_at(node(i % n))));
  }
  for (int t = 0; t < grid.angles; ++t)
    values(0).push_back(float(0.5 * kPi * t / (grid.angles - 1)));
  for (int p = 0; p < grid.azimuths; ++p)
    values(1).push_back(grid.azimuths == 1 ? 0.0F
                                           : float(2.0 * kPi * p / (grid.azimuths - 1) - kPi));
  constexpr double kB = 0.3;
  for (const float phi : values(1))
    for (const float theta : values(0)) {
      const Direction view = direction_from_angles({double(theta), double(phi)});
      const double a = -0.6 + 0.7 * double(theta);
      for (std::size_t i = 0; i < n * n; ++i)
        values(4).push_back(
            float((1.0 + a * (2.0 * node(i % n) - 1.0)) * (1.0 + kB * (2.0 * node(i / n) - 1.0))));
      for (int c = 0; c < 3; ++c)
        for (std::size_t i = 0; i < n * n; ++i) {
          const double x = inverted(a, node(i % n));
          const double y = inverted(kB, node(i / n));
          const double from = grid.azimuths == 1 ? double(phi) : 0.0;
          const Direction m =
              direction_from_angles({0.5 * kPi * x * x, (2.0 * y - 1.0) * kPi + from});
          // Below the horizon too, as the law goes on, so that grids have no edge there.
          const Direction light = 2.0 * m.dot(view) * m - view;
          const double u = std::sqrt(double(theta) * 2.0 / kPi);
          values(5).push_back(
              float((1 + c) * law(view, light) * light.z() * 4.0 * sigma_at(u) / ndf_at(x)));
        }
    }
  return tensor_file(tensors);
}

void expect_law(const SampleSet& set, const Law& law, double error) {
  const std::vector<float> samples = testing::samples_of(set);
  std::size_t i = 0;
  for (const Direction& view : set.info().views)
    for (const Direction& light : set.info().lights)
      for (int c = 0; c < 3; ++c)
        ASSERT_NEAR(samples[i++], (c + 1) * kPi * law(view, light) * light.z(), (c + 1) * error)
            << view.transpose() << " / " << light.transpose();
}

double lambert(const Direction&, const Direction&) { return 1.0 / kPi; }
// Reciprocal, and glossy in the half vector.
double glossy(const Direction& v, const Direction& l) {
  const double z = (v + l).normalized().z();
  return (0.3 + 0.7 * std::pow(z, 4.0)) / kPi;
}
// Brushed along x.
double brushed(const Direction& v, const Direction& l) {
  const Direction m = (v + l).normalized();
  return (0.5 + 0.4 * m.x() * m.x() - 0.2 * m.x() * m.y()) / kPi;
}

// Samples at 64 steps over s: what bilinear interpolation loses of light.z and the gloss, whose
// second derivatives by s reach some 30 (phi turns once, theta goes with the square of u):
// 2 * 30 / 64^2 / 8.
constexpr double kGridError = 2e-3;

TEST(Rgl, ReadsAWhiteLambertianWithTheLightsCosine) {
  const testing::ImportedFile file("rgl", "white_rgb.bsdf");
  file.write(rgl_file(lambert, {}));
  for (const char* directions : {"bonn81", "ubo151"}) {
    ImportOptions options;
    options.directions = directions;
    // The other list has views between the file's angles, 7.5 degrees apart: h^2 / 8 more, of a
    // light that moves twice as far as m.
    const double between = std::string_view(directions) == "bonn81" ? 0.0 : 8e-3;
    expect_law(file.set(options), lambert, kGridError + between);
  }
}

TEST(Rgl, ReadsIsotropicGlossReciprocally) {
  const testing::ImportedFile file("rgl", "gloss_rgb.bsdf");
  file.write(rgl_file(glossy, {}));
  const SampleSet set = file.set();
  expect_law(set, glossy, kGridError);
  // Helmholtz: the cosine is the light's, or this would fail.
  const std::vector<float> samples = testing::samples_of(set);
  const auto& views = set.info().views;
  for (std::size_t v = 0; v < views.size(); ++v)
    for (std::size_t l = 0; l < views.size(); ++l)
      ASSERT_NEAR(double(samples[3 * (v * views.size() + l)]) * views[v].z(),
                  double(samples[3 * (l * views.size() + v)]) * views[l].z(),
                  2.0 * kGridError);
}

TEST(Rgl, TellsAzimuthsApartInAnAnisotropicFile) {
  const testing::ImportedFile file("rgl", "brushed_rgb.bsdf");
  // 10 degrees apart: (10 degrees)^2 / 8 = 4e-3 of the light's turn.
  file.write(rgl_file(brushed, {33, 37, 13}));
  expect_law(file.set(), brushed, 4.0 * kGridError + 8e-3);
}

TEST(Rgl, AViewWithoutNormalsIsFinite) {
  const testing::ImportedFile file("rgl", "black_rgb.bsdf");
  const std::vector<float> zeros(12, 0.0F);
  file.write(tensor_file({{"theta_i", {1}, {0.0F}},
                          {"phi_i", {1}, {0.0F}},
                          {"ndf", {1, 1}, {1.0F}},
                          {"sigma", {1, 1}, {1.0F}},
                          {"vndf", {1, 1, 2, 2}, {0.0F, 0.0F, 0.0F, 0.0F}},
                          {"rgb", {1, 1, 3, 2, 2}, zeros}}));
  for (const float sample : testing::samples_of(file.set())) ASSERT_EQ(sample, 0.0F);
}

std::vector<Tensor> small() {
  return {{"theta_i", {2}, {0.0F, 1.5F}},
          {"phi_i", {1}, {0.0F}},
          {"ndf", {2, 2}, {1.0F, 1.0F, 1.0F, 1.0F}},
          {"sigma", {2, 2}, {1.0F, 1.0F, 1.0F, 1.0F}},
          {"vndf", {1, 2, 2, 2}, std::vector<float>(8, 1.0F)},
          {"rgb", {1, 2, 3, 2, 2}, std::vector<float>(24, 0.5F)}};
}

TEST(Rgl, RefusesOtherFields) {
  const testing::ImportedFile file("rgl", "other.bsdf");
  const auto refused = [&](const std::string& says,
                           const std::function<void(std::vector<Tensor>&)>& change) {
    std::vector<Tensor> tensors = small();
    change(tensors);
    file.write(tensor_file(tensors));
    file.expect_refused(says);
  };
  file.write(tensor_file(small()));
  ASSERT_TRUE(file.import());
  refused("holds spectra", [](auto& t) { t[5].name = "spectra"; });
  refused("has no sigma", [](auto& t) { t[3].name = "alpha"; });
  refused("name of another", [](auto& t) { t[3].name = "ndf"; });
  refused("do not rise", [](auto& t) { t[0].values = {1.0F, 1.0F}; });
  refused("do not match", [](auto& t) { t[4].shape = {2, 1, 2, 2}; });
  refused("3 channels", [](auto& t) { t[5].shape = {1, 2, 2, 3, 2}; });
  refused("below 0", [](auto& t) { t[2].values[1] = -1.0F; });
  refused("not finite", [](auto& t) { t[5].values[7] = std::numeric_limits<float>::quiet_NaN(); });
  refused("none that a sample can take", [](auto& t) { t[3].values.assign(4, 0.0F); });
  refused("less than a turn", [](auto& t) {
    t = {{"theta_i", {1}, {0.0F}},
         {"phi_i", {3}, {0.0F, 1.0F, 2.0F}},
         t[2],
         t[3],
         {"vndf", {3, 1, 1, 1}, {1.0F, 1.0F, 1.0F}},
         {"rgb", {3, 1, 3, 1, 1}, std::vector<float>(9, 1.0F)}};
  });
}

TEST(Rgl, RefusesDamageAndAbsurdCounts) {
  const testing::ImportedFile file("rgl", "damaged.bsdf");
  const std::string bytes = tensor_file(small());
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    file.write(bytes.substr(0, size));
    ASSERT_FALSE(file.import()) << "cut to " << size;
  }
  file.expect_flips_survived(bytes, bytes.size(), 300);
  const auto with = [&](std::size_t at, std::uint64_t value, std::size_t size) {
    std::string damaged = bytes;
    std::memcpy(&damaged[at], &value, size);
    file.write(damaged);
  };
  with(14, 0xFFFFFFFF, 4);
  file.expect_refused("fields, over");
  constexpr std::size_t kOffset = 18 + 2 + 7 + 2 + 1;  // of the first field, theta_i
  with(kOffset, ~std::uint64_t{0}, 8);
  file.expect_refused("beyond the file");
  with(kOffset + 8, ~std::uint64_t{0} / 2, 8);
  file.expect_refused("beyond the file");
  with(kOffset + 8, 0, 8);
  file.expect_refused("no elements");
  with(12, 2, 1);
  file.expect_refused("version 2.0");
}

}  // namespace
}  // namespace veneer::btf
