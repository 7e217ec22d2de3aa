// SPDX-License-Identifier: Apache-2.0
#include "btf/models/dichromatic_lpca/dichromatic_lpca.h"

#include <Eigen/Eigenvalues>

#include <algorithm>
#include <array>

#include "base/parallel.h"
#include "btf/models/components.h"
#include "btf/models/fitted_pairs.h"
#include "btf/models/packed_lpca.h"

namespace veneer::btf {
namespace {

constexpr std::string_view kName = "dichromatic-lpca";
constexpr std::string_view kLearned = "learned";
constexpr std::string_view kRatio = "ratio";
constexpr std::string_view kSubtractive = "subtractive";
constexpr std::string_view kProduct = "product";
constexpr std::string_view kHalfAngle = "half-angle";
constexpr std::string_view kJoint = "joint";
constexpr std::string_view kSeparate = "separate";
constexpr std::string_view kMeasured = "measured";
constexpr int kColours = 1;  // of a texel in the shader

// |D_ref| under this is noise: a thousandth of a white diffuser, the black noise of 12-bit capture.
constexpr float kNoise = 1e-3F;
// Keeps the fade defined for lights measured down to the horizon.
constexpr double kLeastCosine = 1e-6;
// "measured" keeps the half angle while its error of the specular term is at most so many times
// that of the product: a difference that nobody sees.
constexpr double kHalfAngleServes = 1.05;
// "measured" keeps separate clusters where both terms' error is under this share of the joint
// ones': they cost fetches.
constexpr double kSeparateServes = 0.9;

constexpr char kSpecularWeightGlsl[] =
#include "btf/models/specular_weight.glsl.inc"
    ;
constexpr char kGlsl[] =
#include "btf/models/dichromatic_lpca/dichromatic_lpca.glsl.inc"
    ;

using Samples = Eigen::Map<const Eigen::Matrix<float, Eigen::Dynamic, 3, Eigen::RowMajor>>;
using Half3 = Eigen::Matrix<Eigen::half, 3, 1>;

// Everything that is the same for all texels.
struct Terms {
  std::string form;
  bool subtractive = false;
  Eigen::Vector3f specular_colour = Eigen::Vector3f::UnitX();
  Eigen::Vector3f shade_colour =
      Eigen::Vector3f::UnitX();  // of what shadows take away; subtractive
  int masked_texels = 0;         // without body colour; not subtractive

  static Terms of(std::string form) {
    Terms terms;
    terms.subtractive = form == kSubtractive;
    terms.form = std::move(form);
    return terms;
  }
};

Status check_form(std::string_view form, Errc code, std::string_view doing) {
  if (form == kLearned || form == kRatio || form == kSubtractive) return {};
  return fail(code,
              "{}: form is \"{}\"; {} knows {}, {} and {}",
              doing,
              form,
              kName,
              kLearned,
              kRatio,
              kSubtractive);
}

// One of three names, or none.
Status check_choice(std::string_view option,
                    std::string_view value,
                    std::string_view first,
                    std::string_view second) {
  if (value.empty() || value == first || value == second || value == kMeasured) return {};
  return fail(Errc::kInvalidOption,
              "fit: {} is \"{}\"; {} knows {}, {} and {}",
              option,
              value,
              kName,
              first,
              second,
              kMeasured);
}

Status check_choices(const FitOptions& options, std::string_view form) {
  VENEER_TRY(check_choice("specular", options.specular, kProduct, kHalfAngle));
  VENEER_TRY(check_choice("clustering", options.clustering, kJoint, kSeparate));
  if (options.specular == kHalfAngle && form == kSubtractive)
    return fail(Errc::kInvalidOption,
                "fit: a specular term over the {} has a cosine of its own, and form \"{}\" fades "
                "all terms together; choose another form",
                kHalfAngle,
                kSubtractive);
  return {};
}

bool lower(const Direction& a, const Direction& b) { return a.z() < b.z(); }

int nearest_normal(const DirectionSet& directions) {
  return static_cast<int>(std::ranges::max_element(directions, lower) - directions.begin());
}

// The colour that explains most of the energy; grey where there is none.
Eigen::Vector3f best_colour(const Eigen::Matrix3d& gram) {
  if (!(gram.trace() > 0.0)) return Eigen::Vector3f::Constant(1.0F / std::sqrt(3.0F));
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(gram);
  const Eigen::Vector3d colour = solver.eigenvectors().col(2);
  return (colour.sum() < 0.0 ? -colour : colour).cast<float>();
}

// Of a texel whose samples have this weighted sum of outer products and this sum of weights: the
// colour that explains most of their energy, zero where the samples are under the noise.
Eigen::Vector3f learned_colour(const Eigen::Matrix3d& gram, double samples) {
  const double noise = static_cast<double>(kNoise);
  if (!(gram.trace() >= noise * noise * samples)) return Eigen::Vector3f::Zero();
  return best_colour(gram);
}

Eigen::Vector3f colour_at(const std::vector<Eigen::half>& colours, int texel) {
  return Eigen::Map<const Half3>(colours.data() + 3 * texel).cast<float>();
}

class Dichromatic final : public Material {
 public:
  /// @param reference  D_ref, or a colour of length 1 or 0 where it is learned, [texel][3]
  Dichromatic(PackedLpca scalars, Terms terms, std::vector<Eigen::half> reference)
      : scalars_(std::move(scalars)), terms_(std::move(terms)), reference_(std::move(reference)) {
    border_cosine_ = std::max(std::ranges::min_element(lights(), lower)->z(), kLeastCosine);
    colours_ = reference_;
    for (int i = 0; i < scalars_.frame().texel_count() && !terms_.subtractive; ++i)
      Eigen::Map<Half3>(colours_.data() + 3 * i) =
          body_colour(colour_at(reference_, i)).cast<Eigen::half>();
  }

  /// The direction of a reference in RGB; zero where it is under the noise.
  static Eigen::Vector3f body_colour(const Eigen::Vector3f& reference) {
    const float norm = reference.norm();
    return norm < kNoise ? Eigen::Vector3f::Zero() : Eigen::Vector3f(reference / norm);
  }

  std::string_view model() const override { return kName; }
  int width() const override { return scalars_.frame().width; }
  int height() const override { return scalars_.frame().height; }
  const DirectionSet& views() const override { return scalars_.frame().views; }
  const DirectionSet& lights() const override { return scalars_.frame().lights; }

  void reconstruct(int texel, std::span<float> rgb) const override {
    const auto pairs = static_cast<std::size_t>(scalars_.frame().pair_count());
    std::vector<float> functions(2 * pairs);
    scalars_.reconstruct(
        texel, std::span(functions).first(pairs), std::span(functions).last(pairs));
    for (std::size_t i = 0; i < pairs; ++i)
      Eigen::Map<Eigen::Vector3f>(rgb.data() + 3 * i) =
          combine(texel, {functions[i], functions[pairs + i]}).cast<float>();
  }

  Eigen::Vector3d radiance(int texel,
                           const Direction& view,
                           const Direction& light) const override {
    if (!(light.z() > 0.0)) return Eigen::Vector3d::Zero();
    return drawn(texel, scalars_.evaluate(texel, view, light), light);
  }

  bool has_specular_term() const override { return scalars_.components()[1] > 0; }

  Eigen::Vector3d diffuse_radiance(int texel,
                                   const Direction& view,
                                   const Direction& light) const override {
    if (!(light.z() > 0.0)) return Eigen::Vector3d::Zero();
    return drawn(texel, {scalars_.evaluate(texel, view, light)[0], 0.0}, light);
  }

  ModelShader shader() const override {
    ModelShader shader = scalars_.shader(colours_);
    const auto vec3 = [](const Eigen::Vector3f& v) {
      return fmt::format("vec3({:.9g}, {:.9g}, {:.9g})", v[0], v[1], v[2]);
    };
    shader.source += fmt::format(
        "const bool kSubtractive = {};\nconst float kBorderCosine = {:.9g};\n"
        "const vec3 kSpecularColour = {};\nconst vec3 kShadeColour = {};\n",
        terms_.subtractive,
        border_cosine_,
        vec3(terms_.specular_colour),
        vec3(terms_.shade_colour));
    shader.source += kSpecularWeightGlsl;
    shader.source += kGlsl;
    if (terms_.subtractive) shader.cache.reset();
    return shader;
  }

  double values_per_texel() const override { return scalars_.values_per_texel(); }

  Contents contents() const override {
    Contents contents;
    scalars_.add_to(contents);
    contents.metadata["form"] = terms_.form;
    contents.metadata["clustering"] = scalars_.has_separate_clusters() ? kSeparate : kJoint;
    contents.metadata["specular"] = scalars_.has_half_angle() ? kHalfAngle : kProduct;
    contents.metadata["masked_texels"] = fmt::format("{}", terms_.masked_texels);
    contents.tensors.push_back(
        tensor_of("diffuse_reference", {scalars_.frame().texel_count(), 3}, reference_));
    for (const auto& [name, colour] : {std::pair{"specular_colour", &terms_.specular_colour},
                                       std::pair{"shade_colour", &terms_.shade_colour}})
      contents.tensors.push_back(
          {{name, DType::kF32, {3}}, std::as_bytes(std::span(colour->data(), 3))});
    return contents;
  }

 private:
  Eigen::Vector3d combine(int texel, const Eigen::Vector2d& scalars) const {
    const Eigen::Vector3d colour = colour_at(colours_, texel).cast<double>();
    const Eigen::Vector3d specular = scalars[1] * terms_.specular_colour.cast<double>();
    if (terms_.subtractive)
      return colour - scalars[0] * terms_.shade_colour.cast<double>() + specular;
    return scalars[0] * colour + specular;
  }

  Eigen::Vector3d drawn(int texel, const Eigen::Vector2d& scalars, const Direction& light) const {
    const double fade = terms_.subtractive ? std::min(1.0, light.z() / border_cosine_) : 1.0;
    return (fade * combine(texel, scalars)).cwiseMax(0.0);
  }

  PackedLpca scalars_;
  Terms terms_;
  std::vector<Eigen::half> reference_;
  std::vector<Eigen::half> colours_;  // what the shader multiplies or starts from, [texel][3]
  double border_cosine_ = 0.0;        // of the lowest light
};

DirectionRole beyond(bool subtractive) {
  return subtractive ? DirectionRole::kView : DirectionRole::kLight;
}

// Looks at all samples once, each rank at its own: the reference, the colours and how many texels
// are masked.
Terms find_terms(const SampleSet& set,
                 const FittedPairs& fitted,
                 std::string form,
                 std::vector<Eigen::half>& reference,
                 Communicator& ranks,
                 Progress& progress) {
  Terms terms = Terms::of(std::move(form));
  const bool learned = terms.form == kLearned;
  const MaterialFrame& info = fitted.frame();
  const int reference_pair = nearest_normal(info.views) * static_cast<int>(info.lights.size()) +
                             nearest_normal(info.lights);
  const auto pairs = static_cast<Eigen::Index>(info.pair_count());
  const Eigen::VectorXd weights = fitted.all_weights().cast<double>().matrix();
  const RowRange own = rows_of_rank(info.texel_count(), ranks);
  reference.resize(static_cast<std::size_t>(own.count) * 3);
  // One texel's share at a place of its own, so that the sum has one order whatever the threads do.
  std::vector<Eigen::Matrix3d> specular(static_cast<std::size_t>(own.count));
  std::vector<Eigen::Matrix3d> shade(specular.size());
  const auto gram = [&weights](const Eigen::MatrixX3d& values) -> Eigen::Matrix3d {
    return values.transpose() * weights.asDiagonal() * values;
  };
  progress.start("colours", own.count);
  parallel_for(own.count, 16, [&](std::int64_t begin, std::int64_t end) {
    std::vector<float> rgb(static_cast<std::size_t>(pairs) * 3);
    const Samples samples(rgb.data(), pairs, 3);
    for (auto i = static_cast<int>(begin); i < end; ++i) {
      const auto index = static_cast<std::size_t>(i);
      fitted.rgb(set, own.first + i, Part::kDiffuse, rgb);
      const Eigen::RowVector3f here = samples.row(reference_pair);
      const Eigen::MatrixX3d diffuse = samples.cast<double>();
      Eigen::Map<Half3>(reference.data() + 3 * i) =
          (learned ? learned_colour(gram(diffuse), weights.sum()) : here.transpose())
              .cast<Eigen::half>();
      const Eigen::MatrixX3d taken = (samples.rowwise() - here).cast<double>();
      shade[index] = gram(taken);
      fitted.rgb(set, own.first + i, Part::kSpecular, rgb);
      const Eigen::MatrixX3d shine = samples.cast<double>();
      specular[index] = gram(shine);
    }
    progress.advance(end - begin);
  });
  // Of the specular parts, of the shading.
  std::array<Eigen::Matrix3d, 2> sums{Eigen::Matrix3d::Zero(), Eigen::Matrix3d::Zero()};
  for (std::size_t i = 0; i < specular.size(); ++i) {
    sums[0] += specular[i];
    sums[1] += shade[i];
  }
  for (Eigen::Matrix3d& sum : sums) ranks.sum({sum.data(), 9});
  terms.specular_colour = best_colour(sums[0]);
  terms.shade_colour = best_colour(sums[1]);
  reference = gather<Eigen::half>(ranks, reference);
  for (int i = 0; i < info.texel_count() && !terms.subtractive; ++i)
    if (colour_at(reference, i).norm() < kNoise) ++terms.masked_texels;
  progress.finish(terms.masked_texels == 0
                      ? std::string()
                      : fmt::format("{} texels too dark", terms.masked_texels));
  return terms;
}

// Whether the specular term may be kept over the half angle.
bool serves(const PackedLpca& half_angle,
            const PackedLpca& product,
            const PackedLpca::Read& read,
            const FittedPairs& pairs,
            Progress& progress) {
  progress.start("specular term", 1);
  const double with = half_angle.rmse(read, pairs)[1];
  const double without = product.rmse(read, pairs)[1];
  progress.finish(fmt::format("rmse {:.3g} over the half angle, {:.3g} without", with, without));
  return with <= kHalfAngleServes * without;
}

}  // namespace

Result<std::unique_ptr<Material>> fit_dichromatic_lpca(const SampleSet& set,
                                                       const FitOptions& options,
                                                       Progress& progress) {
  VENEER_TRY(options.check());
  VENEER_TRY(refuse_mip_levels(options, kName));
  VENEER_TRY(refuse_precision(options, kName));
  VENEER_ASSIGN(const PackedLpca::Components components,
                parse_two_terms(options.components, kName));
  const std::string form = options.form.empty() ? std::string(kLearned) : options.form;
  VENEER_TRY(check_form(form, Errc::kInvalidOption, "fit"));
  VENEER_TRY(check_choices(options, form));
  if (!set.info().polarised)
    return fail(
        Errc::kInvalidOption,
        "fit: {} has no specular and diffuse parts, which {} needs; fit texel-colours to it, or "
        "capture the sample with polarisers",
        set.path().string(),
        kName);
  VENEER_ASSIGN(const FittedPairs pairs, FittedPairs::of(set.info(), options.region));
  const MaterialFrame& frame = pairs.frame();
  const PackedLpca::Layout layout{.components = components,
                                  .angular = options.angular,
                                  .boxes = pairs.boxes(),
                                  .beyond = beyond(form == kSubtractive),
                                  .colours = kColours};
  VENEER_TRY(PackedLpca::check(frame, layout, options.clusters, Errc::kInvalidOption, "fit"));
  VENEER_TRY(check_samples(set, options));

  std::vector<Eigen::half> reference;
  Terms terms = find_terms(set, pairs, form, reference, *options.ranks, progress);
  const auto read = [&](int texel, std::span<float> shading, std::span<float> specular) {
    std::vector<float> rgb(3 * shading.size());
    const Samples samples(rgb.data(), frame.pair_count(), 3);
    Eigen::Map<Eigen::VectorXf> first(shading.data(), samples.rows());
    const Eigen::Vector3f here = colour_at(reference, texel);
    pairs.rgb(set, texel, Part::kDiffuse, rgb);
    if (terms.subtractive)
      first = (here.dot(terms.shade_colour) - (samples * terms.shade_colour).array()).matrix();
    else
      first = samples * Dichromatic::body_colour(here);
    pairs.rgb(set, texel, Part::kSpecular, rgb);
    Eigen::Map<Eigen::VectorXf>(specular.data(), samples.rows()) = samples * terms.specular_colour;
  };
  const auto fit_scalars = [&](bool separate) {
    PackedLpca::Layout own = layout;
    own.separate = separate;
    return PackedLpca::fit(pairs, options, own, read, progress);
  };
  const bool has_specular = components[1] > 0;
  VENEER_ASSIGN(PackedLpca scalars, fit_scalars(has_specular && options.clustering == kSeparate));
  if (has_specular && options.clustering == kMeasured) {
    VENEER_ASSIGN(PackedLpca separate, fit_scalars(true));
    if (separate.rmse(read, pairs).norm() < kSeparateServes * scalars.rmse(read, pairs).norm())
      scalars = std::move(separate);
  }
  const bool measured = options.specular == kMeasured && !terms.subtractive;
  if (has_specular && (measured || options.specular == kHalfAngle)) {
    PackedLpca half_angle = scalars.with_half_angle(read, pairs, *options.ranks);
    if (!measured || serves(half_angle, scalars, read, pairs, progress))
      scalars = std::move(half_angle);
  }
  return std::make_unique<Dichromatic>(std::move(scalars), std::move(terms), std::move(reference));
}

Result<std::unique_ptr<Material>> load_dichromatic_lpca(const SafetensorsFile& file) {
  VENEER_ASSIGN(const std::string form, file.meta("form"));
  VENEER_TRY(check_form(form, Errc::kBadFormat, fmt::format("reading {}", file.path().string())));
  Terms terms = Terms::of(form);
  // Files from before there was a choice hold products in joint clusters.
  const std::string specular = file.meta("specular").value_or(std::string(kProduct));
  if (specular != kProduct && (specular != kHalfAngle || terms.subtractive))
    return fail(Errc::kBadFormat,
                "reading {}: specular is \"{}\" in form \"{}\"; {} knows {}, and {} but in form {}",
                file.path().string(),
                specular,
                form,
                kName,
                kProduct,
                kHalfAngle,
                kSubtractive);
  const std::string clustering = file.meta("clustering").value_or(std::string(kJoint));
  if (clustering != kJoint && clustering != kSeparate)
    return fail(Errc::kBadFormat,
                "reading {}: clustering is \"{}\"; {} knows {} and {}",
                file.path().string(),
                clustering,
                kName,
                kJoint,
                kSeparate);
  VENEER_ASSIGN(PackedLpca scalars,
                PackedLpca::load(file,
                                 {.beyond = beyond(terms.subtractive),
                                  .colours = kColours,
                                  .separate = clustering == kSeparate,
                                  .half_angle = specular == kHalfAngle}));
  const int texels = scalars.frame().texel_count();
  VENEER_ASSIGN(terms.masked_texels, read_integer(file, "masked_texels", 0, texels));
  for (const auto& [name, colour] : {std::pair{"specular_colour", &terms.specular_colour},
                                     std::pair{"shade_colour", &terms.shade_colour}}) {
    VENEER_ASSIGN(const TensorView tensor, file.tensor(name, DType::kF32, {3}));
    *colour = Eigen::Map<const Eigen::Vector3f>(tensor.as<float>().data());
    if (!colour->allFinite())
      return fail(Errc::kBadFormat, "reading {}: {} is not finite", file.path().string(), name);
  }
  VENEER_ASSIGN(std::vector<Eigen::half> reference,
                read_halves(file, "diffuse_reference", {texels, 3}));
  return std::make_unique<Dichromatic>(std::move(scalars), std::move(terms), std::move(reference));
}

}  // namespace veneer::btf
