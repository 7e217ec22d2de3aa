// SPDX-License-Identifier: Apache-2.0
#include "btf/models/texel_colours/texel_colours.h"

#include <Eigen/Eigenvalues>

#include <array>

#include "base/parallel.h"
#include "btf/models/components.h"
#include "btf/models/fitted_pairs.h"
#include "btf/models/lpca_factors.h"
#include "btf/models/packed_lpca.h"

namespace veneer::btf {
namespace {

constexpr std::string_view kName = "texel-colours";
constexpr int kColours = 2;

constexpr char kGlsl[] =
#include "btf/models/texel_colours/texel_colours.glsl.inc"
    ;

using Samples = Eigen::Map<const Eigen::Matrix<float, Eigen::Dynamic, 3, Eigen::RowMajor>>;
// One colour a row.
using Basis = Eigen::Matrix<float, kColours, 3, Eigen::RowMajor>;
using HalfBasis = Eigen::Matrix<Eigen::half, kColours, 3, Eigen::RowMajor>;

// @param weights  of the samples
Basis colour_basis(const Samples& samples, const Eigen::VectorXd& weights) {
  // In double: float would lose the second colour of an almost grey texel.
  const Eigen::Matrix<double, Eigen::Dynamic, 3> precise = samples.cast<double>();
  const Eigen::Matrix<double, Eigen::Dynamic, 3> weighted = weights.asDiagonal() * precise;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(precise.transpose() * weighted);
  Basis basis;
  for (int c = 0; c < kColours; ++c) {
    Eigen::Vector3d colour = solver.eigenvectors().col(2 - c);
    // A sign must be chosen: the first function's mean, and the second colour's largest element, >=
    // 0.
    int largest = 0;
    colour.cwiseAbs().maxCoeff(&largest);
    const double sign = c == 0 ? weighted.colwise().sum().dot(colour) : colour[largest];
    basis.row(c) = (sign < 0.0 ? -colour : colour).cast<float>();
  }
  return basis;
}

class TexelColours final : public Material {
 public:
  /// @param colours  [texel][colour][3]
  TexelColours(PackedLpca scalars, std::vector<Eigen::half> colours)
      : scalars_(std::move(scalars)), colours_(std::move(colours)) {}

  std::string_view model() const override { return kName; }
  int width() const override { return scalars_.frame().width; }
  int height() const override { return scalars_.frame().height; }
  int mip_levels() const override { return scalars_.pyramid().levels(); }
  const DirectionSet& views() const override { return scalars_.frame().views; }
  const DirectionSet& lights() const override { return scalars_.frame().lights; }

  void reconstruct(int texel, std::span<float> rgb) const override {
    const auto pairs = static_cast<std::size_t>(scalars_.frame().pair_count());
    std::vector<float> functions(kColours * pairs);
    scalars_.reconstruct(
        texel, std::span(functions).first(pairs), std::span(functions).last(pairs));
    const Basis colours = basis(texel);
    for (std::size_t i = 0; i < pairs; ++i)
      Eigen::Map<Eigen::RowVector3f>(rgb.data() + 3 * i) =
          functions[i] * colours.row(0) + functions[pairs + i] * colours.row(1);
  }

  Eigen::Vector3d radiance(int texel,
                           const Direction& view,
                           const Direction& light) const override {
    if (!(light.z() > 0.0)) return Eigen::Vector3d::Zero();
    const Eigen::Vector2d scalars = scalars_.evaluate(texel, view, light);
    return (basis(texel).cast<double>().transpose() * scalars).cwiseMax(0.0);
  }

  ModelShader shader() const override {
    ModelShader shader = scalars_.shader(colours_);
    shader.source += kGlsl;
    return shader;
  }

  double values_per_texel() const override { return scalars_.values_per_texel(); }

  Contents contents() const override {
    Contents contents;
    scalars_.add_to(contents);
    contents.tensors.push_back(
        tensor_of("colours", {scalars_.pyramid().texel_count(), kColours, 3}, colours_));
    return contents;
  }

 private:
  Basis basis(int texel) const {
    return Eigen::Map<const HalfBasis>(colours_.data() + 3 * kColours * texel).cast<float>();
  }

  PackedLpca scalars_;
  std::vector<Eigen::half> colours_;  // [texel][colour][3]
};

}  // namespace

Result<std::unique_ptr<Material>> fit_texel_colours(const SampleSet& set,
                                                    const FitOptions& options,
                                                    Progress& progress) {
  VENEER_TRY(options.check());
  VENEER_TRY(refuse_form(options, kName));
  VENEER_TRY(refuse_precision(options, kName));
  VENEER_ASSIGN(const PackedLpca::Components components,
                parse_two_terms(options.components, kName));
  VENEER_ASSIGN(const FittedPairs pairs, FittedPairs::of(set.info(), options.region));
  const MaterialFrame& frame = pairs.frame();
  const PackedLpca::Layout layout{.components = components,
                                  .angular = options.angular,
                                  .boxes = pairs.boxes(),
                                  .colours = kColours,
                                  .mip_levels = options.mip_levels};
  VENEER_TRY(PackedLpca::check(frame, layout, options.clusters, Errc::kInvalidOption, "fit"));
  VENEER_TRY(check_samples(set, options));
  const auto values = static_cast<std::size_t>(frame.pair_count()) * 3;

  const TexelPyramid pyramid(frame.width, frame.height, options.mip_levels);
  const RowRange own = rows_of_rank(pyramid.texel_count(), *options.ranks);
  const Eigen::VectorXd weights = pairs.all_weights().cast<double>().matrix();
  progress.start("colours", own.count);
  std::vector<Eigen::half> colours(static_cast<std::size_t>(own.count) * kColours * 3);
  parallel_for(own.count, 16, [&](std::int64_t begin, std::int64_t end) {
    std::vector<float> rgb(values);
    for (auto i = static_cast<int>(begin); i < end; ++i) {
      pairs.rgb(set, pyramid, own.first + i, Part::kTotal, rgb);
      Eigen::Map<HalfBasis>(colours.data() + 3 * kColours * i) =
          colour_basis(Samples(rgb.data(), frame.pair_count(), 3), weights).cast<Eigen::half>();
    }
    progress.advance(end - begin);
  });
  colours = gather<Eigen::half>(*options.ranks, colours);
  progress.finish();

  const auto read = [&](int texel, std::span<float> first, std::span<float> second) {
    std::vector<float> rgb(values);
    pairs.rgb(set, pyramid, texel, Part::kTotal, rgb);
    const Samples samples(rgb.data(), frame.pair_count(), 3);
    const Basis basis =
        Eigen::Map<const HalfBasis>(colours.data() + 3 * kColours * texel).cast<float>();
    Eigen::Map<Eigen::VectorXf>(first.data(), samples.rows()) = samples * basis.row(0).transpose();
    Eigen::Map<Eigen::VectorXf>(second.data(), samples.rows()) = samples * basis.row(1).transpose();
  };
  VENEER_ASSIGN(PackedLpca scalars, PackedLpca::fit(pairs, options, layout, read, progress));
  return std::make_unique<TexelColours>(std::move(scalars), std::move(colours));
}

Result<std::unique_ptr<Material>> load_texel_colours(const SafetensorsFile& file) {
  VENEER_ASSIGN(PackedLpca scalars, PackedLpca::load(file, {.colours = kColours}, true));
  VENEER_ASSIGN(std::vector<Eigen::half> colours,
                read_halves(file, "colours", {scalars.pyramid().texel_count(), kColours, 3}));
  return std::make_unique<TexelColours>(std::move(scalars), std::move(colours));
}

}  // namespace veneer::btf
