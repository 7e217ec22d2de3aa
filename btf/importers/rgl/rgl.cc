// SPDX-License-Identifier: Apache-2.0
#include "btf/importers/rgl/rgl.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "btf/importers/brdf.h"
#include "btf/importers/rgl/tensor_file.h"

namespace veneer::btf {
namespace {

constexpr double kPi = std::numbers::pi;
using Floats = TensorFile::Floats;

// Between which two of some nodes a value lies, and how far towards the second.
struct Place {
  std::size_t first = 0;
  std::size_t second = 0;
  double part = 0.0;
};

// Among evenly spaced nodes on [0, 1], held beyond it.
Place place_on(std::size_t nodes, double u) {
  const double at = std::clamp(u, 0.0, 1.0) * static_cast<double>(nodes - 1);
  const auto first = std::min(static_cast<std::size_t>(at), nodes - 1);
  return {first, std::min(first + 1, nodes - 1), at - static_cast<double>(first)};
}

// Among rising angles.
Place place_among(const std::vector<float>& nodes, double angle) {
  const auto above = std::ranges::upper_bound(nodes, static_cast<float>(angle));
  if (above == nodes.begin()) return {};
  const auto second = static_cast<std::size_t>(above - nodes.begin());
  if (second == nodes.size()) return {second - 1, second - 1, 0.0};
  const double low = nodes[second - 1];
  const double part = (angle - low) / (static_cast<double>(nodes[second]) - low);
  return {second - 1, second, std::clamp(part, 0.0, 1.0)};
}

// A grid [rows][columns] at u = (along columns, along rows).
double bilinear(std::span<const float> grid, std::size_t columns, const Eigen::Vector2d& u) {
  const Place x = place_on(columns, u.x());
  const Place y = place_on(grid.size() / columns, u.y());
  const auto row = [&](std::size_t r) {
    const double low = grid[r * columns + x.first];
    return low + x.part * (static_cast<double>(grid[r * columns + x.second]) - low);
  };
  return row(y.first) + y.part * (row(y.second) - row(y.first));
}

// The integral over [0, u] of what is linear between evenly spaced nodes on [0, 1].
double integral(std::span<const double> nodes, double u) {
  if (nodes.size() == 1) return u * nodes[0];
  const Place place = place_on(nodes.size(), u);
  double sum = 0.0;
  for (std::size_t i = 0; i < place.first; ++i) sum += 0.5 * (nodes[i] + nodes[i + 1]);
  const double slope = nodes[place.second] - nodes[place.first];
  sum += place.part * (nodes[place.first] + 0.5 * place.part * slope);
  return sum / static_cast<double>(nodes.size() - 1);
}

double cumulative(std::span<const double> nodes, double u) {
  const double whole = integral(nodes, 1.0);
  return whole > 0.0 ? std::clamp(integral(nodes, u) / whole, 0.0, 1.0) : 0.0;
}

class RglBrdf {
 public:
  [[nodiscard]] static Result<RglBrdf> read(const std::filesystem::path& path) {
    VENEER_ASSIGN(const TensorFile file, TensorFile::open(path));
    const std::string doing = fmt::format("reading {}", path.string());
    if (file.has("spectra") && !file.has("rgb"))
      return fail(Errc::kBadFormat,
                  "{}: it holds spectra; take the RGB variant of the material (_rgb.bsdf)",
                  doing);
    RglBrdf brdf;
    VENEER_ASSIGN(const Floats theta, file.floats("theta_i", 1));
    VENEER_ASSIGN(const Floats phi, file.floats("phi_i", 1));
    brdf.theta_ = theta.values;
    brdf.phi_ = phi.values;
    for (const std::vector<float>* angles : {&brdf.theta_, &brdf.phi_})
      if (std::ranges::adjacent_find(*angles, std::greater_equal<>()) != angles->end())
        return fail(Errc::kBadFormat, "{}: its angles do not rise", doing);
    constexpr std::size_t kMostIsotropic = 2;
    brdf.isotropic_ = brdf.phi_.size() <= kMostIsotropic;
    constexpr double kTurn = 2.0 * kPi - 1e-3;
    if (!brdf.isotropic_ && static_cast<double>(brdf.phi_.back() - brdf.phi_.front()) < kTurn)
      return fail(
          Errc::kBadFormat, "{}: its azimuths cover less than a turn, which is not known", doing);
    VENEER_ASSIGN(brdf.ndf_, file.floats("ndf", 2));
    VENEER_ASSIGN(brdf.sigma_, file.floats("sigma", 2));
    VENEER_ASSIGN(brdf.vndf_, file.floats("vndf", 4));
    VENEER_ASSIGN(brdf.rgb_, file.floats("rgb", 5));
    for (const Floats* positive : {&brdf.ndf_, &brdf.sigma_, &brdf.vndf_})
      if (std::ranges::min(positive->values) < 0.0F)
        return fail(Errc::kBadFormat, "{}: ndf, sigma or vndf is below 0", doing);
    for (const Floats* slices : {&brdf.vndf_, &brdf.rgb_})
      if (slices->shape[0] != brdf.phi_.size() || slices->shape[1] != brdf.theta_.size())
        return fail(Errc::kBadFormat, "{}: its slices do not match its angles", doing);
    if (brdf.rgb_.shape[2] != 3) return fail(Errc::kBadFormat, "{}: rgb has no 3 channels", doing);
    return brdf;
  }

  // f_r cos(theta_l). @param view, light  above the horizon, or the value is 0.
  [[nodiscard]] Eigen::Vector3d reflected(const Direction& view, const Direction& light) {
    const Direction sum = view + light;
    if (!(view.z() > 0.0) || !(light.z() > 0.0)) return Eigen::Vector3d::Zero();
    if (view != view_) look_from(view);
    const Direction m = sum.normalized();
    const double phi = isotropic_ ? azimuth(m) - azimuth(view) : azimuth(m);
    const Eigen::Vector2d u = unit(m, phi);
    const Eigen::Vector2d s = sample_of(u);
    const double scale =
        bilinear(ndf_.values, ndf_.shape[1], u) /
        (4.0 * bilinear(sigma_.values, sigma_.shape[1], unit(view, azimuth(view))));
    const std::size_t columns = rgb_.shape[4];
    const std::size_t size = rgb_.shape[3] * columns;
    Eigen::Vector3d rgb = Eigen::Vector3d::Zero();
    for (std::size_t c = 0; c < 3; ++c)
      for (const auto& [slice, weight] : slices_)
        rgb[static_cast<Eigen::Index>(c)] +=
            weight *
            bilinear(std::span(rgb_.values).subspan((3 * slice + c) * size, size), columns, s);
    return (rgb * scale).cwiseMax(0.0);
  }

 private:
  static double azimuth(const Direction& d) { return std::atan2(d.y(), d.x()); }
  static Eigen::Vector2d unit(const Direction& d, double phi) {
    const double turns = (phi + kPi) / (2.0 * kPi);
    return {std::sqrt(std::acos(std::min(d.z(), 1.0)) * 2.0 / kPi), turns - std::floor(turns)};
  }

  // Mixes the slices of vndf for a view: cumulative distributions of a mixture are linear in what
  // is not normalised, so they are taken after it.
  void look_from(const Direction& view) {
    view_ = view;
    // In the file's turn, which may begin anywhere.
    const double turns = (azimuth(view) - static_cast<double>(phi_.front())) / (2.0 * kPi);
    const Place phi = place_among(phi_, azimuth(view) - 2.0 * kPi * std::floor(turns));
    const Place theta = place_among(theta_, std::acos(std::min(view.z(), 1.0)));
    const std::size_t thetas = theta_.size();
    slices_ = {{phi.first * thetas + theta.first, (1.0 - phi.part) * (1.0 - theta.part)},
               {phi.first * thetas + theta.second, (1.0 - phi.part) * theta.part},
               {phi.second * thetas + theta.first, phi.part * (1.0 - theta.part)},
               {phi.second * thetas + theta.second, phi.part * theta.part}};
    const std::size_t columns = vndf_.shape[3];
    mixed_.assign(vndf_.shape[2] * columns, 0.0);
    for (const auto& [slice, weight] : slices_)
      for (std::size_t i = 0; i < mixed_.size(); ++i)
        mixed_[i] += weight * static_cast<double>(vndf_.values[slice * mixed_.size() + i]);
    rows_.clear();
    for (std::size_t row = 0; row < vndf_.shape[2]; ++row)
      rows_.push_back(integral(std::span(mixed_).subspan(row * columns, columns), 1.0));
  }

  [[nodiscard]] Eigen::Vector2d sample_of(const Eigen::Vector2d& u) const {
    const std::size_t columns = vndf_.shape[3];
    const Place y = place_on(rows_.size(), u.y());
    std::vector<double> row(columns);
    for (std::size_t i = 0; i < columns; ++i) {
      const double low = mixed_[y.first * columns + i];
      row[i] = low + y.part * (mixed_[y.second * columns + i] - low);
    }
    return {cumulative(row, u.x()), cumulative(rows_, u.y())};
  }

  bool isotropic_ = true;
  std::vector<float> theta_;
  std::vector<float> phi_;
  Floats ndf_;    // [phi_m][theta_m]
  Floats sigma_;  // [phi][theta]
  Floats vndf_;   // [phi_i][theta_i][phi_m][theta_m]
  Floats rgb_;    // [phi_i][theta_i][3][second of s][first of s]

  // For the view looked from:
  struct Slice {
    std::size_t index;
    double weight;
  };
  Direction view_ = Direction::Zero();
  std::vector<Slice> slices_;
  std::vector<double> mixed_;  // vndf
  std::vector<double> rows_;   // its integrals along theta_m
};

}  // namespace

Status import_rgl(const std::filesystem::path& source,
                  const std::filesystem::path& set,
                  const ImportOptions& options,
                  Progress& progress) {
  VENEER_ASSIGN(RglBrdf brdf, RglBrdf::read(source));
  progress.start("sampling the BRDF", 1);
  VENEER_TRY(write_brdf(
      source,
      set,
      options,
      fmt::format("RGL BRDF {}", source.filename().string()),
      "that of the RGL material database",
      [&](const Direction& view, const Direction& light) { return brdf.reflected(view, light); }));
  progress.advance();
  progress.finish();
  return {};
}

}  // namespace veneer::btf
