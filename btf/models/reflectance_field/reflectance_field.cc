// SPDX-License-Identifier: Apache-2.0
#include "btf/models/reflectance_field/reflectance_field.h"

#include <algorithm>
#include <array>
#include <atomic>

#include "base/parallel.h"
#include "btf/models/components.h"
#include "btf/models/direction_lookup.h"
#include "btf/models/lobes/lafortune_lobes.h"

namespace veneer::btf {
namespace {

constexpr std::string_view kName = "reflectance-field";
// What float leaves of a difference of squares.
constexpr double kParallel = 1e-6;

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
constexpr char kGlsl[] =
#include "btf/models/reflectance_field/reflectance_field.glsl.inc"
    ;

int layers_of(const MaterialFrame& frame, int lobes) {
  return 1 + static_cast<int>(frame.views.size()) * (1 + lobes);
}

// What is stored.
struct Fields {
  int lobes = 0;
  int fallback_texels = 0;
  std::vector<Eigen::half> diffuse = {};   // [texel][3]
  std::vector<Eigen::half> specular = {};  // [texel][view][3]
  std::vector<Eigen::half> shapes = {};    // [texel][view][lobe][kLobeValues]
};

// One texel while it is fitted.
struct TexelFields {
  std::array<Eigen::half, 3> diffuse = {};
  std::vector<StoredLobes> views = {};
  bool fell_back = false;
};

class FieldFitter {
 public:
  FieldFitter(const MaterialFrame& frame, int lobes)
      : lights_(static_cast<Eigen::Index>(frame.lights.size())),
        fitter_(light_samples(frame), lobes) {
    for (const Direction& view : frame.views) {
      const Eigen::Vector3f v = view.cast<float>();
      // Mirrored light, light thrown back, and a wide lobe about the normal.
      starts_.push_back({LobeShape{{-v.x(), -v.y(), v.z()}, 10.0F},
                         LobeShape{v, 5.0F},
                         LobeShape{Eigen::Vector3f::UnitZ(), 2.0F}});
    }
  }

  [[nodiscard]] TexelFields fit(const LobeTargets& all) const {
    std::vector<LobeTargets> targets;
    for (Eigen::Index view = 0; view < static_cast<Eigen::Index>(starts_.size()); ++view)
      targets.push_back({all.weight.segment(view * lights_, lights_),
                         all.rgb.middleRows(view * lights_, lights_)});
    // Every view by itself, then what diffuse colour they have in common, then what is left.
    std::vector<std::vector<LobeShape>> shapes;
    for (std::size_t view = 0; view < targets.size(); ++view)
      shapes.push_back(fitter_.fit(targets[view], starts_[view]));
    TexelFields fields{.diffuse = shared_diffuse(targets, shapes)};
    double squared_error = 0.0;
    for (std::size_t view = 0; view < targets.size(); ++view) {
      take_off(fields.diffuse, targets[view]);
      fitter_.refine(targets[view], Diffuse::kGiven, shapes[view]);
      StoredLobes black = fitter_.store(targets[view], Diffuse::kGiven, {});
      StoredLobes fitted = fitter_.store(targets[view], Diffuse::kGiven, shapes[view]);
      const bool better = fitted.squared_error < black.squared_error;
      fields.views.push_back(better ? std::move(fitted) : std::move(black));
      squared_error += fields.views.back().squared_error;
    }
    const TexelFields lambert = diffuse_alone(all);
    return squared_error < lambert.views.front().squared_error ? fields : lambert;
  }

 private:
  // The diffuse colour that fits best where each view's lobes may still scale: the views' specular
  // colours are eliminated from the normal equations of both.
  [[nodiscard]] std::array<Eigen::half, 3> shared_diffuse(
      const std::vector<LobeTargets>& targets,
      const std::vector<std::vector<LobeShape>>& shapes) const {
    Eigen::Array3d above = Eigen::Array3d::Zero();
    double below = 0.0;
    for (std::size_t view = 0; view < targets.size(); ++view) {
      const LobeTargets& target = targets[view];
      const StoredLobes stored = fitter_.store(target, Diffuse::kFree, shapes[view]);
      const Eigen::VectorXd cosine =
          (target.weight * fitter_.samples().cosine).matrix().cast<double>();
      const Eigen::VectorXd lobes =
          (target.weight * fitter_.lobes_at_samples(stored)).matrix().cast<double>();
      const double square = lobes.squaredNorm();
      const double part = square > 0.0 ? lobes.dot(cosine) / square : 0.0;
      const Eigen::VectorXd rest = cosine - part * lobes;
      // Lobes that look like the diffuse part, as they do for a single light, say nothing about it.
      if (!(rest.squaredNorm() > kParallel * cosine.squaredNorm())) continue;
      above += (rest.transpose() * target.rgb.cast<double>()).transpose().array();
      below += rest.squaredNorm();
    }
    std::array<Eigen::half, 3> diffuse{};
    for (std::size_t c = 0; c < 3; ++c)
      diffuse[c] = saturated_half(
          below > 0.0
              ? static_cast<float>(std::max(above[static_cast<Eigen::Index>(c)], 0.0) / below)
              : 0.0F);
    return diffuse;
  }

  void take_off(const std::array<Eigen::half, 3>& diffuse, LobeTargets& target) const {
    for (Eigen::Index c = 0; c < 3; ++c)
      target.rgb.col(c) -= static_cast<float>(diffuse[static_cast<std::size_t>(c)]) *
                           (target.weight * fitter_.samples().cosine).matrix();
  }

  // Lambert; its error stands in the first view.
  [[nodiscard]] TexelFields diffuse_alone(const LobeTargets& all) const {
    const auto views = static_cast<Eigen::Index>(starts_.size());
    const Eigen::ArrayXf cosine = all.weight * fitter_.samples().cosine.replicate(views, 1);
    const double square = cosine.cast<double>().matrix().squaredNorm();
    TexelFields fields{.fell_back = true};
    const LobeTargets nothing{Eigen::ArrayXf::Zero(lights_), Eigen::MatrixX3f::Zero(lights_, 3)};
    fields.views.assign(starts_.size(), fitter_.store(nothing, Diffuse::kGiven, {}));
    for (Eigen::Index c = 0; c < 3; ++c) {
      const double dot = all.rgb.col(c).cast<double>().dot(cosine.cast<double>().matrix());
      Eigen::half& diffuse = fields.diffuse[static_cast<std::size_t>(c)];
      diffuse =
          saturated_half(square > 0.0 ? static_cast<float>(std::max(dot, 0.0) / square) : 0.0F);
      fields.views.front().squared_error += static_cast<double>(
          (all.rgb.col(c) - static_cast<float>(diffuse) * cosine.matrix()).squaredNorm());
    }
    return fields;
  }

  Eigen::Index lights_;
  LobeFitter fitter_;
  std::vector<std::vector<LobeShape>> starts_;  // of each view
};

class ReflectanceField final : public Material {
 public:
  ReflectanceField(MaterialFrame frame, Fields fields)
      : frame_(std::move(frame)),
        fields_(std::move(fields)),
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
             Eigen::Vector3d(light.z() * (diffuse(texel) + specular(texel, view, light))))
          *out++ = static_cast<float>(value);
  }

  Eigen::Vector3d radiance(int texel,
                           const Direction& view,
                           const Direction& light) const override {
    if (!(light.z() > 0.0)) return Eigen::Vector3d::Zero();
    const DirectionWeights v = views_.weights({view.x(), view.y(), std::max(view.z(), 0.0)});
    Eigen::Vector3d sum = diffuse(texel);
    for (std::size_t i = 0; i < 3; ++i)
      sum += v.weight[i] * specular(texel, static_cast<std::size_t>(v.index[i]), light);
    return light.z() * sum;
  }

  bool has_specular_term() const override { return true; }

  Eigen::Vector3d diffuse_radiance(int texel,
                                   const Direction& /*view*/,
                                   const Direction& light) const override {
    return std::max(0.0, light.z()) * diffuse(texel);
  }

  ModelShader shader() const override {
    ModelShader shader;
    shader.source = fmt::format("const ivec2 kTexels = ivec2({}, {});\nconst int kLobes = {};\n",
                                frame_.width,
                                frame_.height,
                                fields_.lobes);
    for (const char* part : {kElevatedConcentricGlsl,
                             kDirectionLookupGlsl,
                             kSpecularWeightGlsl,
                             kTexelAtGlsl,
                             kLobesGlsl,
                             kGlsl})
      shader.source += part;
    LayerWriter writer(frame_.texel_count(), layers_of(frame_, fields_.lobes));
    for (int texel = 0; texel < frame_.texel_count(); ++texel) {
      writer.put(
          0, texel, std::span(fields_.diffuse).subspan(3 * static_cast<std::size_t>(texel), 3));
      int layer = 1;
      for (std::size_t view = 0; view < frame_.views.size(); ++view) {
        writer.put(layer++, texel, std::span(fields_.specular).subspan(3 * at(texel, view), 3));
        for (int i = 0; i < fields_.lobes; ++i) writer.put(layer++, texel, shape(texel, view, i));
      }
    }
    shader.textures.push_back(writer.texture("Fields", frame_));
    views_.add_textures("View", shader.textures);
    shader.fetches = 1 + DirectionLookup::kFetches + 3 * (1 + fields_.lobes);
    return shader;
  }

  double values_per_texel() const override {
    return 3.0 + static_cast<double>(frame_.views.size()) * (3 + kLobeValues * fields_.lobes);
  }

  Contents contents() const override {
    Contents contents;
    add_frame(frame_, contents);
    const std::int64_t texels = frame_.texel_count();
    const auto view_count = static_cast<std::int64_t>(frame_.views.size());
    contents.metadata["lobes"] = fmt::format("{}", fields_.lobes);
    contents.metadata["fallback_texels"] = fmt::format("{}", fields_.fallback_texels);
    contents.tensors.push_back(tensor_of("diffuse", {texels, 3}, fields_.diffuse));
    contents.tensors.push_back(tensor_of("specular", {texels, view_count, 3}, fields_.specular));
    contents.tensors.push_back(
        tensor_of("lobes", {texels, view_count, fields_.lobes, kLobeValues}, fields_.shapes));
    return contents;
  }

 private:
  std::size_t at(int texel, std::size_t view) const {
    return static_cast<std::size_t>(texel) * frame_.views.size() + view;
  }
  std::span<const Eigen::half> shape(int texel, std::size_t view, int lobe) const {
    return std::span(fields_.shapes)
        .subspan(kLobeValues * (at(texel, view) * static_cast<std::size_t>(fields_.lobes) +
                                static_cast<std::size_t>(lobe)),
                 kLobeValues);
  }
  Eigen::Vector3d diffuse(int texel) const {
    return colour_at(fields_.diffuse, static_cast<std::size_t>(texel));
  }
  // Without the cosine.
  Eigen::Vector3d specular(int texel, std::size_t view, const Direction& light) const {
    double sum = 0.0;
    for (int i = 0; i < fields_.lobes; ++i) sum += lobe_value(shape(texel, view, i), light);
    return sum * colour_at(fields_.specular, at(texel, view));
  }

  MaterialFrame frame_;
  Fields fields_;
  DirectionLookup views_;
};

}  // namespace

Result<std::unique_ptr<Material>> fit_reflectance_field(const SampleSet& set,
                                                        const FitOptions& options,
                                                        Progress& progress) {
  VENEER_TRY(options.check());
  VENEER_TRY(refuse_mip_levels(options, kName));
  VENEER_TRY(refuse_form(options, kName));
  VENEER_TRY(refuse_precision(options, kName));
  VENEER_ASSIGN(const FittedPairs pairs, FittedPairs::of(set.info(), options.region));
  const MaterialFrame& frame = pairs.frame();
  VENEER_TRY(check_array(
      "the fields", frame, layers_of(frame, options.lobes), Errc::kInvalidOption, "fit"));
  VENEER_TRY(set.check_finite());

  const FieldFitter fitter(frame, options.lobes);
  const auto texels = static_cast<std::size_t>(frame.texel_count());
  const std::size_t views = frame.views.size();
  const auto values = static_cast<std::size_t>(kLobeValues * options.lobes);  // of a view's lobes
  Fields fields{.lobes = options.lobes};
  fields.diffuse.resize(3 * texels);
  fields.specular.resize(3 * texels * views);
  fields.shapes.resize(values * texels * views);
  std::atomic<int> fallbacks = 0;
  const std::vector<float> importance = pairs.weights_everywhere();
  progress.start("reflectance fields", frame.texel_count());
  parallel_for(frame.texel_count(), 4, [&](std::int64_t begin, std::int64_t end) {
    std::vector<float> rgb(3 * static_cast<std::size_t>(frame.pair_count()));
    for (auto texel = static_cast<std::size_t>(begin); texel < static_cast<std::size_t>(end);
         ++texel) {
      pairs.rgb(set, static_cast<int>(texel), Part::kTotal, rgb);
      const TexelFields fit = fitter.fit(weighted_targets(rgb, importance));
      std::ranges::copy(fit.diffuse, &fields.diffuse[3 * texel]);
      for (std::size_t view = 0; view < views; ++view) {
        const std::size_t at = texel * views + view;
        std::ranges::copy(fit.views[view].specular, &fields.specular[3 * at]);
        std::ranges::copy(fit.views[view].lobes, &fields.shapes[values * at]);
      }
      fallbacks += fit.fell_back ? 1 : 0;
    }
    progress.advance(end - begin);
  });
  fields.fallback_texels = fallbacks;
  progress.finish(fallback_remark(fallbacks));
  return std::make_unique<ReflectanceField>(frame, std::move(fields));
}

Result<std::unique_ptr<Material>> load_reflectance_field(const SafetensorsFile& file) {
  VENEER_ASSIGN(MaterialFrame frame, read_frame(file));
  Fields fields;
  VENEER_ASSIGN(fields.lobes, read_integer(file, "lobes", 1, FitOptions::kMostLobes));
  VENEER_ASSIGN(fields.fallback_texels,
                read_integer(file, "fallback_texels", 0, frame.texel_count()));
  VENEER_TRY(check_array("the fields",
                         frame,
                         layers_of(frame, fields.lobes),
                         Errc::kBadFormat,
                         fmt::format("reading {}", file.path().string())));
  const std::int64_t texels = frame.texel_count();
  const auto views = static_cast<std::int64_t>(frame.views.size());
  VENEER_ASSIGN(fields.diffuse, read_colours(file, "diffuse", {texels, 3}));
  VENEER_ASSIGN(fields.specular, read_colours(file, "specular", {texels, views, 3}));
  VENEER_ASSIGN(fields.shapes, read_lobes(file, {texels, views, fields.lobes, kLobeValues}));
  return std::make_unique<ReflectanceField>(std::move(frame), std::move(fields));
}

}  // namespace veneer::btf
