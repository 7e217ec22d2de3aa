// SPDX-License-Identifier: Apache-2.0
#include "btf/models/scaled_lafortune/scaled_lafortune.h"

#include <algorithm>
#include <atomic>

#include "base/parallel.h"
#include "btf/models/components.h"
#include "btf/models/direction_lookup.h"
#include "btf/models/lobes/lafortune_lobes.h"

namespace veneer::btf {
namespace {

constexpr std::string_view kName = "scaled-lafortune";

constexpr char kElevatedConcentricGlsl[] =
#include "btf/models/elevated_concentric.glsl.inc"
    ;
constexpr char kDirectionLookupGlsl[] =
#include "btf/models/direction_lookup.glsl.inc"
    ;
constexpr char kSpecularWeightGlsl[] =
#include "btf/models/specular_weight.glsl.inc"
    ;
constexpr char kTexelAtGlsl[] =
#include "btf/models/texel_at.glsl.inc"
    ;
constexpr char kLobesGlsl[] =
#include "btf/models/lobes/lobes.glsl.inc"
    ;
constexpr char kLafortuneLobesGlsl[] =
#include "btf/models/lobes/lafortune_lobes.glsl.inc"
    ;
constexpr char kGlsl[] =
#include "btf/models/scaled_lafortune/scaled_lafortune.glsl.inc"
    ;

Status check_textures(const MaterialFrame& frame, int lobes, Errc code, std::string_view doing) {
  VENEER_TRY(check_array("the lobes", frame, 2 + lobes, code, doing));
  return check_array(
      "the views' factors", frame, static_cast<std::int64_t>(frame.views.size()), code, doing);
}

// Factors of one texel, a row each view, and what they leave.
struct Factors {
  Eigen::MatrixX3f value;
  double squared_error = 0.0;
};

Factors factors_of(const LobeFitter& fitter,
                   const LobeTargets& targets,
                   const StoredLobes& stored,
                   Eigen::Index lights) {
  const Eigen::ArrayXf lobes = targets.weight * fitter.lobes_at_samples(stored);
  const Eigen::ArrayXf cosine = targets.weight * fitter.samples().cosine;
  Factors factors{.value = Eigen::MatrixX3f(targets.rgb.rows() / lights, 3)};
  for (Eigen::Index channel = 0; channel < 3; ++channel) {
    const auto c = static_cast<std::size_t>(channel);
    const Eigen::ArrayXf model = cosine * static_cast<float>(stored.diffuse[c]) +
                                 lobes * static_cast<float>(stored.specular[c]);
    for (Eigen::Index view = 0; view < factors.value.rows(); ++view) {
      const Eigen::VectorXd m = model.segment(view * lights, lights).matrix().cast<double>();
      const Eigen::VectorXd y =
          targets.rgb.col(channel).segment(view * lights, lights).cast<double>();
      const double square = m.squaredNorm();
      // Where the lobes give nothing, no factor helps.
      const double best = square > 0.0 ? std::max(0.0, m.dot(y)) / square : 1.0;
      const auto kept = static_cast<float>(saturated_half(static_cast<float>(best)));
      factors.value(view, channel) = kept;
      factors.squared_error += (y - static_cast<double>(kept) * m).squaredNorm();
    }
  }
  return factors;
}

// What the lobes have to give so that, times the factors, they are the samples: each view divided
// by its factors, and counted by their mean.
LobeTargets divided(const LobeTargets& targets, const Factors& factors, Eigen::Index lights) {
  LobeTargets result = targets;
  for (Eigen::Index view = 0; view < factors.value.rows(); ++view) {
    const float mean = factors.value.row(view).mean();
    result.weight.segment(view * lights, lights) *= mean;
    for (Eigen::Index channel = 0; channel < 3; ++channel) {
      const float factor = factors.value(view, channel);
      result.rgb.col(channel).segment(view * lights, lights) *=
          factor > 0.0F ? mean / factor : 0.0F;
    }
  }
  return result;
}

class ScaledLafortune final : public Material {
 public:
  /// @param factors  [texel][view][3]
  ScaledLafortune(MaterialFrame frame, LafortuneLobes lobes, std::vector<Eigen::half> factors)
      : frame_(std::move(frame)),
        lobes_(std::move(lobes)),
        factors_(std::move(factors)),
        views_(frame_.views, DirectionRole::kView) {}

  std::string_view model() const override { return kName; }
  int width() const override { return frame_.width; }
  int height() const override { return frame_.height; }
  const DirectionSet& views() const override { return frame_.views; }
  const DirectionSet& lights() const override { return frame_.lights; }

  void reconstruct(int texel, std::span<float> rgb) const override {
    auto out = rgb.begin();
    for (std::size_t view = 0; view < frame_.views.size(); ++view)
      for (const Direction& light : frame_.lights)
        for (const double value :
             Eigen::Vector3d(factor(texel, view)
                                 .cwiseProduct(lobes_.evaluate(texel, frame_.views[view], light))))
          *out++ = static_cast<float>(value);
  }

  Eigen::Vector3d radiance(int texel,
                           const Direction& view,
                           const Direction& light) const override {
    if (!(light.z() > 0.0)) return Eigen::Vector3d::Zero();
    const Direction above(view.x(), view.y(), std::max(view.z(), 0.0));
    return factor_towards(texel, above).cwiseProduct(lobes_.evaluate(texel, above, light));
  }

  bool has_specular_term() const override { return true; }

  Eigen::Vector3d diffuse_radiance(int texel,
                                   const Direction& view,
                                   const Direction& light) const override {
    if (!(light.z() > 0.0)) return Eigen::Vector3d::Zero();
    const Direction above(view.x(), view.y(), std::max(view.z(), 0.0));
    return factor_towards(texel, above).cwiseProduct(lobes_.evaluate_diffuse(texel, light));
  }

  ModelShader shader() const override {
    ModelShader shader;
    shader.source = fmt::format("const ivec2 kTexels = ivec2({}, {});\nconst int kLobes = {};\n",
                                frame_.width,
                                frame_.height,
                                lobes_.lobes);
    for (const char* part : {kElevatedConcentricGlsl,
                             kDirectionLookupGlsl,
                             kSpecularWeightGlsl,
                             kTexelAtGlsl,
                             kLobesGlsl,
                             kLafortuneLobesGlsl,
                             kGlsl})
      shader.source += part;
    shader.textures.push_back(lobes_.texture(frame_));
    const auto views = static_cast<int>(frame_.views.size());
    LayerWriter writer(frame_.texel_count(), views);
    for (int texel = 0; texel < frame_.texel_count(); ++texel)
      for (int view = 0; view < views; ++view)
        writer.put(view,
                   texel,
                   std::span(factors_).subspan(at(texel, static_cast<std::size_t>(view)) * 3, 3));
    shader.textures.push_back(writer.texture("Factors", frame_));
    views_.add_textures("View", shader.textures);
    shader.fetches = lobes_.layers() + DirectionLookup::kFetches + 3;
    return shader;
  }

  double values_per_texel() const override {
    return lobes_.values_per_texel() + 3.0 * static_cast<double>(frame_.views.size());
  }

  Contents contents() const override {
    Contents contents;
    add_frame(frame_, contents);
    lobes_.add_to(frame_.texel_count(), contents);
    contents.tensors.push_back(tensor_of("factors", factor_shape(frame_), factors_));
    return contents;
  }

  static std::vector<std::int64_t> factor_shape(const MaterialFrame& frame) {
    return {frame.texel_count(), static_cast<std::int64_t>(frame.views.size()), 3};
  }

 private:
  std::size_t at(int texel, std::size_t view) const {
    return static_cast<std::size_t>(texel) * frame_.views.size() + view;
  }
  Eigen::Vector3d factor(int texel, std::size_t view) const {
    return colour_at(factors_, at(texel, view));
  }
  Eigen::Vector3d factor_towards(int texel, const Direction& view) const {
    const DirectionWeights v = views_.weights(view);
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (std::size_t i = 0; i < 3; ++i)
      sum += v.weight[i] * factor(texel, static_cast<std::size_t>(v.index[i]));
    return sum;
  }

  MaterialFrame frame_;
  LafortuneLobes lobes_;
  std::vector<Eigen::half> factors_;  // [texel][view][3]
  DirectionLookup views_;
};

}  // namespace

Result<std::unique_ptr<Material>> fit_scaled_lafortune(const SampleSet& set,
                                                       const FitOptions& options,
                                                       Progress& progress) {
  VENEER_TRY(options.check());
  VENEER_TRY(refuse_mip_levels(options, kName));
  VENEER_TRY(refuse_form(options, kName));
  VENEER_TRY(refuse_precision(options, kName));
  VENEER_ASSIGN(const FittedPairs pairs, FittedPairs::of(set.info(), options.region));
  const MaterialFrame& frame = pairs.frame();
  VENEER_TRY(check_textures(frame, options.lobes, Errc::kInvalidOption, "fit"));
  VENEER_TRY(set.check_finite());

  const LobeFitter fitter(pair_samples(frame), options.lobes);
  const auto lights = static_cast<Eigen::Index>(frame.lights.size());
  LafortuneLobes lobes(frame.texel_count(), options.lobes);
  const std::size_t values = 3 * frame.views.size();  // of a texel's factors
  std::vector<Eigen::half> factors(values * static_cast<std::size_t>(frame.texel_count()));
  std::atomic<int> fallbacks = 0;
  const std::vector<float> importance = pairs.weights_everywhere();
  progress.start("scaled lobes", frame.texel_count());
  parallel_for(frame.texel_count(), 8, [&](std::int64_t begin, std::int64_t end) {
    std::vector<float> rgb(3 * static_cast<std::size_t>(frame.pair_count()));
    for (auto texel = static_cast<int>(begin); texel < end; ++texel) {
      pairs.rgb(set, texel, Part::kTotal, rgb);
      const LobeTargets targets = weighted_targets(rgb, importance);
      TexelFit fit = fit_texel(fitter, targets);
      Factors best = factors_of(fitter, targets, fit.stored, lights);
      if (!fit.fell_back) {
        const LobeTargets scaled = divided(targets, best, lights);
        std::vector<LobeShape> shapes = LobeFitter::shapes_of(fit.stored);
        fitter.refine(scaled, Diffuse::kFree, shapes);
        StoredLobes refined = fitter.store(scaled, Diffuse::kFree, shapes);
        Factors again = factors_of(fitter, targets, refined, lights);
        if (again.squared_error < best.squared_error) {
          best = std::move(again);
          fit.stored = std::move(refined);
        }
      }
      lobes.set_texel(texel, fit.stored);
      fallbacks += fit.fell_back ? 1 : 0;
      using RowMajor = Eigen::Matrix<Eigen::half, Eigen::Dynamic, 3, Eigen::RowMajor>;
      Eigen::Map<RowMajor>(
          &factors[values * static_cast<std::size_t>(texel)], best.value.rows(), 3) =
          best.value.cast<Eigen::half>();
    }
    progress.advance(end - begin);
  });
  lobes.fallback_texels = fallbacks;
  progress.finish(fallback_remark(fallbacks));
  return std::make_unique<ScaledLafortune>(frame, std::move(lobes), std::move(factors));
}

Result<std::unique_ptr<Material>> load_scaled_lafortune(const SafetensorsFile& file) {
  VENEER_ASSIGN(MaterialFrame frame, read_frame(file));
  VENEER_ASSIGN(LafortuneLobes lobes, LafortuneLobes::read(file, frame));
  VENEER_TRY(check_textures(
      frame, lobes.lobes, Errc::kBadFormat, fmt::format("reading {}", file.path().string())));
  VENEER_ASSIGN(std::vector<Eigen::half> factors,
                read_colours(file, "factors", ScaledLafortune::factor_shape(frame)));
  return std::make_unique<ScaledLafortune>(std::move(frame), std::move(lobes), std::move(factors));
}

}  // namespace veneer::btf
