// SPDX-License-Identifier: Apache-2.0
#include "btf/models/phong/phong.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>

#include "base/parallel.h"
#include "btf/models/components.h"
#include "btf/models/lobes/lafortune_lobes.h"

namespace veneer::btf {
namespace {

constexpr std::string_view kName = "phong";
constexpr int kLayers = 2;
constexpr std::size_t kValues = 5;  // diffuse R, G, B, strength, exponent

constexpr char kSpecularWeightGlsl[] =
#include "btf/models/specular_weight.glsl.inc"
    ;
constexpr char kTexelAtGlsl[] =
#include "btf/models/texel_at.glsl.inc"
    ;
constexpr char kLobesGlsl[] =
#include "btf/models/lobes/lobes.glsl.inc"
    ;
constexpr char kGlsl[] =
#include "btf/models/phong/phong.glsl.inc"
    ;

using Values = std::array<Eigen::half, kValues>;

struct PhongFit {
  Values values{};
  bool fell_back = false;
};

// The exponent is looked for on a geometric grid, then by golden sections between its neighbours.
constexpr int kGrid = 16;
constexpr int kSections = 12;

class PhongFitter {
 public:
  explicit PhongFitter(const MaterialFrame& frame) : samples_(pair_samples(frame)) {
    constexpr float kTinyBase = 1e-6F;
    logarithm_ =
        (samples_.u.matrix() * Eigen::Vector3f(-1.0F, -1.0F, 1.0F)).array().max(kTinyBase).log();
  }

  [[nodiscard]] PhongFit fit(const LobeTargets& targets) const {
    const Eigen::VectorXf cosine = targets.weight * samples_.cosine;
    const Known known{cosine,
                      static_cast<double>(cosine.squaredNorm()),
                      (cosine.transpose() * targets.rgb).cast<double>().transpose(),
                      targets.rgb.rowwise().sum()};
    const float step = std::log(kMostExponent / kLeastExponent) / (kGrid - 1);
    const auto gain_at = [&](float log_exponent) {
      return solve(targets, known, std::exp(log_exponent)).gain;
    };
    int best = 0;
    double most = -1.0;
    for (int i = 0; i < kGrid; ++i) {
      const double gain = gain_at(static_cast<float>(i) * step);
      if (!(gain > most)) continue;
      most = gain;
      best = i;
    }
    float low = static_cast<float>(std::max(best - 1, 0)) * step;
    float high = static_cast<float>(std::min(best + 1, kGrid - 1)) * step;
    constexpr float kGolden = 0.618034F;
    for (int i = 0; i < kSections; ++i) {
      const float left = high - kGolden * (high - low);
      const float right = low + kGolden * (high - low);
      if (gain_at(left) > gain_at(right))
        high = right;
      else
        low = left;
    }
    const float exponent = std::clamp(std::exp(0.5F * (low + high)), kLeastExponent, kMostExponent);
    const Eigen::half stored(exponent);
    const Solution solution = solve(targets, known, static_cast<float>(stored));
    PhongFit result;
    for (std::size_t c = 0; c < 3; ++c)
      result.values[c] =
          saturated_half(static_cast<float>(solution.diffuse[static_cast<Eigen::Index>(c)]));
    result.values[3] = saturated_half(static_cast<float>(solution.strength));
    result.values[4] = stored;
    result.fell_back = !(solution.strength > 0.0);
    return result;
  }

 private:
  // What does not depend on the exponent.
  struct Known {
    const Eigen::VectorXf& cosine;
    double square;              // of the cosine
    Eigen::Vector3d by_target;  // the cosine times each channel
    Eigen::VectorXf grey;       // sum of the channels
  };
  struct Solution {
    Eigen::Vector3d diffuse = Eigen::Vector3d::Zero();
    double strength = 0.0;
    double gain = 0.0;  // squared error of black less that of this
  };

  // Least squares for the diffuse colour and the strength, all >= 0. Channels whose diffuse part
  // would be negative lose it one after another.
  [[nodiscard]] Solution solve(const LobeTargets& targets,
                               const Known& known,
                               float exponent) const {
    Solution solution;
    if (!(known.square > 0.0)) return solution;
    // Floored so that squares do not underflow, which would take a hundred times as long.
    constexpr float kLeastLogarithm = -30.0F;
    const Eigen::VectorXf lobe =
        targets.weight * (exponent * logarithm_).max(kLeastLogarithm).exp();
    const auto square = static_cast<double>(lobe.squaredNorm());
    const auto cross = static_cast<double>(lobe.dot(known.cosine));
    const auto by_grey = static_cast<double>(lobe.dot(known.grey));
    std::array<bool, 3> is_diffuse{true, true, true};
    for (int round = 0; round < 4; ++round) {
      double above = by_grey;
      double below = 3.0 * square;
      for (Eigen::Index c = 0; c < 3; ++c) {
        if (!is_diffuse[static_cast<std::size_t>(c)]) continue;
        above -= cross * known.by_target[c] / known.square;
        below -= cross * cross / known.square;
      }
      constexpr double kParallel = 1e-6;  // of the lobe: what float leaves of a difference
      solution.strength = below > kParallel * square ? std::max(above, 0.0) / below : 0.0;
      bool again = false;
      for (Eigen::Index c = 0; c < 3; ++c) {
        const auto at = static_cast<std::size_t>(c);
        const double diffuse = (known.by_target[c] - solution.strength * cross) / known.square;
        if (is_diffuse[at] && diffuse < 0.0) {
          is_diffuse[at] = false;
          again = true;
        }
        solution.diffuse[c] = is_diffuse[at] ? diffuse : 0.0;
      }
      if (!again) break;
    }
    const double s = solution.strength;
    solution.gain = 2.0 * (solution.diffuse.dot(known.by_target) + s * by_grey) -
                    solution.diffuse.squaredNorm() * known.square - 3.0 * s * s * square -
                    2.0 * s * cross * solution.diffuse.sum();
    return solution;
  }

  LobeSamples samples_;
  Eigen::ArrayXf logarithm_;  // of the lobe's base
};

class Phong final : public Material {
 public:
  /// @param values  [texel][kValues]
  Phong(MaterialFrame frame, std::vector<Eigen::half> values, int fallback_texels)
      : frame_(std::move(frame)), values_(std::move(values)), fallback_texels_(fallback_texels) {}

  std::string_view model() const override { return kName; }
  int width() const override { return frame_.width; }
  int height() const override { return frame_.height; }
  const DirectionSet& views() const override { return frame_.views; }
  const DirectionSet& lights() const override { return frame_.lights; }

  void reconstruct(int texel, std::span<float> rgb) const override {
    auto out = rgb.begin();
    for (const Direction& view : frame_.views)
      for (const Direction& light : frame_.lights)
        for (const double value : evaluate(texel, view, light)) *out++ = static_cast<float>(value);
  }

  Eigen::Vector3d radiance(int texel,
                           const Direction& view,
                           const Direction& light) const override {
    if (!(light.z() > 0.0)) return Eigen::Vector3d::Zero();
    return evaluate(texel, {view.x(), view.y(), std::max(view.z(), 0.0)}, light);
  }

  bool has_specular_term() const override { return true; }

  Eigen::Vector3d diffuse_radiance(int texel,
                                   const Direction& /*view*/,
                                   const Direction& light) const override {
    return std::max(0.0, light.z()) * colour_at(of(texel), 0);
  }

  ModelShader shader() const override {
    ModelShader shader;
    shader.source =
        fmt::format("const ivec2 kTexels = ivec2({}, {});\n", frame_.width, frame_.height);
    for (const char* part : {kSpecularWeightGlsl, kTexelAtGlsl, kLobesGlsl, kGlsl})
      shader.source += part;
    LayerWriter writer(frame_.texel_count(), kLayers);
    for (int texel = 0; texel < frame_.texel_count(); ++texel) {
      writer.put(0, texel, of(texel).first(4));
      writer.put(1, texel, of(texel).last(1));
    }
    shader.textures.push_back(writer.texture("Texels", frame_));
    shader.fetches = kLayers;
    return shader;
  }

  double values_per_texel() const override { return kValues; }

  Contents contents() const override {
    Contents contents;
    add_frame(frame_, contents);
    contents.metadata["fallback_texels"] = fmt::format("{}", fallback_texels_);
    contents.tensors.push_back(
        tensor_of("texels", {frame_.texel_count(), static_cast<std::int64_t>(kValues)}, values_));
    return contents;
  }

 private:
  std::span<const Eigen::half> of(int texel) const {
    return std::span(values_).subspan(kValues * static_cast<std::size_t>(texel), kValues);
  }
  Eigen::Vector3d evaluate(int texel, const Direction& view, const Direction& light) const {
    const std::span<const Eigen::half> values = of(texel);
    const std::array<Eigen::half, kLobeValues> lobe{
        Eigen::half(-1.0F), Eigen::half(-1.0F), Eigen::half(1.0F), values[4]};
    return light.z() * colour_at(values, 0) +
           Eigen::Vector3d::Constant(static_cast<double>(values[3]) *
                                     lobe_value(lobe, view.cwiseProduct(light)));
  }

  MaterialFrame frame_;
  std::vector<Eigen::half> values_;  // [texel][kValues]
  int fallback_texels_;              // whose highlight gained nothing
};

}  // namespace

Result<std::unique_ptr<Material>> fit_phong(const SampleSet& set,
                                            const FitOptions& options,
                                            Progress& progress) {
  VENEER_TRY(options.check());
  VENEER_TRY(refuse_mip_levels(options, kName));
  VENEER_TRY(refuse_form(options, kName));
  VENEER_TRY(refuse_precision(options, kName));
  VENEER_ASSIGN(const FittedPairs pairs, FittedPairs::of(set.info(), options.region));
  const MaterialFrame& frame = pairs.frame();
  VENEER_TRY(check_array("the texels", frame, kLayers, Errc::kInvalidOption, "fit"));
  VENEER_TRY(set.check_finite());
  const PhongFitter fitter(frame);
  std::vector<Eigen::half> values(kValues * static_cast<std::size_t>(frame.texel_count()));
  std::atomic<int> fallbacks = 0;
  const std::vector<float> importance = pairs.weights_everywhere();
  progress.start("highlights", frame.texel_count());
  parallel_for(frame.texel_count(), 16, [&](std::int64_t begin, std::int64_t end) {
    std::vector<float> rgb(3 * static_cast<std::size_t>(frame.pair_count()));
    for (auto texel = static_cast<int>(begin); texel < end; ++texel) {
      pairs.rgb(set, texel, Part::kTotal, rgb);
      const PhongFit fit = fitter.fit(weighted_targets(rgb, importance));
      std::ranges::copy(fit.values, &values[kValues * static_cast<std::size_t>(texel)]);
      fallbacks += fit.fell_back ? 1 : 0;
    }
    progress.advance(end - begin);
  });
  progress.finish(fallback_remark(fallbacks));
  return std::make_unique<Phong>(frame, std::move(values), fallbacks);
}

Result<std::unique_ptr<Material>> load_phong(const SafetensorsFile& file) {
  VENEER_ASSIGN(MaterialFrame frame, read_frame(file));
  VENEER_ASSIGN(const int fallback_texels,
                read_integer(file, "fallback_texels", 0, frame.texel_count()));
  VENEER_ASSIGN(
      std::vector<Eigen::half> values,
      read_halves(file, "texels", {frame.texel_count(), static_cast<std::int64_t>(kValues)}));
  for (std::size_t i = 0; i < values.size(); ++i) {
    const auto value = static_cast<float>(values[i]);
    const bool is_exponent = i % kValues == kValues - 1;
    if (is_exponent ? value >= kLeastExponent && value <= kMostExponent : value >= 0.0F) continue;
    return fail(
        Errc::kBadFormat,
        "reading {}: texels: element {} is {}; colours are not negative and exponents {} to "
        "{}",
        file.path().string(),
        i,
        value,
        kLeastExponent,
        kMostExponent);
  }
  return std::make_unique<Phong>(std::move(frame), std::move(values), fallback_texels);
}

}  // namespace veneer::btf
