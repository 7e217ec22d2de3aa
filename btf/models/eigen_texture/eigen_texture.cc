// SPDX-License-Identifier: Apache-2.0
#include "btf/models/eigen_texture/eigen_texture.h"

#include <algorithm>
#include <iterator>

#include "btf/models/components.h"
#include "btf/models/direction_lookup.h"
#include "btf/models/eigen_texture/eigen_images.h"

namespace veneer::btf {
namespace {

constexpr std::string_view kName = "eigen-texture";
constexpr int kLanes = 4;  // of a texel of either texture
// Every GL 4.5 takes arrays of this many layers.
constexpr int kMostLayers = 2048;
constexpr std::int64_t kMostBytes = std::int64_t{2} << 30;

constexpr char kElevatedConcentricGlsl[] =
#include "btf/models/elevated_concentric.glsl.inc"
    ;
constexpr char kDirectionLookupGlsl[] =
#include "btf/models/direction_lookup.glsl.inc"
    ;
constexpr char kTexelAtGlsl[] =
#include "btf/models/texel_at.glsl.inc"
    ;
constexpr char kGlsl[] =
#include "btf/models/eigen_texture/eigen_texture.glsl.inc"
    ;

int words_for(int values) { return (values + kLanes - 1) / kLanes; }

TexelFormat format_of(Precision precision) {
  return precision == Precision::k8Bit ? TexelFormat::kRgba8 : TexelFormat::kRgba16f;
}

Status check_textures(const MaterialFrame& frame,
                      int components,
                      Precision precision,
                      Errc code,
                      std::string_view doing) {
  VENEER_TRY(check_texture("the texels", frame.width, frame.height, code, doing));
  VENEER_TRY(check_texture("the weights",
                           static_cast<std::int64_t>(frame.lights.size()),
                           static_cast<std::int64_t>(frame.views.size()) * words_for(components),
                           code,
                           doing));
  const auto layers = static_cast<std::int64_t>(frame.views.size()) * words_for(3 * components);
  if (layers > kMostLayers)
    return fail(code,
                "{}: {} components of {} views take {} layers of a texture array, over {}; choose "
                "fewer components",
                doing,
                components,
                frame.views.size(),
                layers,
                kMostLayers);
  const std::int64_t bytes = layers * frame.texel_count() *
                             static_cast<std::int64_t>(bytes_per_texel(format_of(precision)));
  if (bytes > kMostBytes)
    return fail(
        code,
        "{}: the Eigen-textures would take {:.1f} GiB on the GPU, over {}; crop the sample, "
        "choose fewer components or the precision 8bit",
        doing,
        double(bytes) / double(1 << 30),
        kMostBytes >> 30);
  return {};
}

class EigenTexture final : public Material {
 public:
  EigenTexture(MaterialFrame frame, EigenImages images)
      : frame_(std::move(frame)),
        images_(std::move(images)),
        views_(frame_.views, DirectionRole::kView),
        lights_(frame_.lights, DirectionRole::kLight) {}

  std::string_view model() const override { return kName; }
  int width() const override { return frame_.width; }
  int height() const override { return frame_.height; }
  const DirectionSet& views() const override { return frame_.views; }
  const DirectionSet& lights() const override { return frame_.lights; }

  void reconstruct(int texel, std::span<float> rgb) const override {
    std::ranges::fill(rgb, 0.0F);
    const std::size_t lights = frame_.lights.size();
    for (std::size_t view = 0; view < frame_.views.size(); ++view)
      for (int i = 0; i < images_.components; ++i) {
        const Eigen::Vector3f image = images_.image(image_index(view, texel), i).cast<float>();
        for (std::size_t light = 0; light < lights; ++light)
          Eigen::Map<Eigen::Vector3f>(&rgb[3 * (view * lights + light)]) +=
              static_cast<float>(weight(view, light, i)) * image;
      }
  }

  Eigen::Vector3d radiance(int texel,
                           const Direction& view,
                           const Direction& light) const override {
    if (!(light.z() > 0.0)) return Eigen::Vector3d::Zero();
    const DirectionWeights v =
        views_.weights(Direction(view.x(), view.y(), std::max(view.z(), 0.0)));
    const DirectionWeights l = lights_.weights(light);
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (std::size_t n = 0; n < 3; ++n) {
      const auto near_view = static_cast<std::size_t>(v.index[n]);
      for (int i = 0; i < images_.components; ++i) {
        double mixed = 0.0;
        for (std::size_t m = 0; m < 3; ++m)
          mixed += l.weight[m] *
                   static_cast<double>(weight(near_view, static_cast<std::size_t>(l.index[m]), i));
        sum += v.weight[n] * l.scale * mixed * images_.image(image_index(near_view, texel), i);
      }
    }
    return sum.cwiseMax(0.0);
  }

  ModelShader shader() const override;

  // The weights are shared by the whole set.
  double values_per_texel() const override {
    return double(images_.values()) * static_cast<double>(frame_.views.size());
  }

  Contents contents() const override {
    Contents contents;
    add_frame(frame_, contents);
    contents.metadata["components"] = fmt::format("{}", images_.components);
    contents.metadata["precision"] = name_of(images_.precision);
    const auto views = static_cast<std::int64_t>(frame_.views.size());
    const std::vector<std::int64_t> shape{views, frame_.texel_count(), images_.components, 3};
    contents.tensors.push_back(
        tensor_of("weights",
                  {views, static_cast<std::int64_t>(frame_.lights.size()), images_.components},
                  images_.weights));
    if (images_.precision == Precision::k8Bit) {
      contents.tensors.push_back(tensor_of("zeros", {images_.components}, images_.zeros));
      contents.tensors.push_back(tensor_of("eigen_textures", shape, images_.codes));
    } else {
      contents.tensors.push_back(tensor_of("eigen_textures", shape, images_.halves));
    }
    return contents;
  }

 private:
  std::size_t image_index(std::size_t view, int texel) const {
    return view * static_cast<std::size_t>(frame_.texel_count()) + static_cast<std::size_t>(texel);
  }
  Eigen::half weight(std::size_t view, std::size_t light, int component) const {
    return images_.weights[(view * frame_.lights.size() + light) *
                               static_cast<std::size_t>(images_.components) +
                           static_cast<std::size_t>(component)];
  }
  ModelTexture pack_weights() const;
  ModelTexture pack_images() const;
  std::string texel_source() const;

  MaterialFrame frame_;
  EigenImages images_;
  DirectionLookup views_;
  DirectionLookup lights_;
};

// A column for each light, rows for each view's weights, four to a texel.
ModelTexture EigenTexture::pack_weights() const {
  const int words = words_for(images_.components);
  ModelTexture texture{.sampler = "EigenWeights",
                       .format = TexelFormat::kRgba16f,
                       .width = static_cast<int>(frame_.lights.size()),
                       .height = static_cast<int>(frame_.views.size()) * words};
  std::vector<Eigen::half> lanes(static_cast<std::size_t>(texture.width) *
                                 static_cast<std::size_t>(texture.height) * kLanes);
  for (std::size_t view = 0; view < frame_.views.size(); ++view)
    for (std::size_t light = 0; light < frame_.lights.size(); ++light)
      for (int i = 0; i < images_.components; ++i) {
        const std::size_t row =
            view * static_cast<std::size_t>(words) + static_cast<std::size_t>(i / kLanes);
        lanes[(row * frame_.lights.size() + light) * kLanes +
              static_cast<std::size_t>(i % kLanes)] = weight(view, light, i);
      }
  texture.data = texture_data(lanes);
  return texture;
}

// [view][values, four to a layer][texel][4]
template <class T>
std::vector<T> in_layers(const std::vector<T>& images, int texels, int values) {
  const auto count = static_cast<std::size_t>(values);
  const auto pixels = static_cast<std::size_t>(texels);
  const auto layers = static_cast<std::size_t>(words_for(values));
  std::vector<T> lanes(images.size() / count * layers * kLanes);
  for (std::size_t i = 0; i < images.size(); ++i) {
    const std::size_t value = i % count;
    const std::size_t texel = i / count % pixels;
    const std::size_t view = i / count / pixels;
    lanes[((view * layers + value / kLanes) * pixels + texel) * kLanes + value % kLanes] =
        images[i];
  }
  return lanes;
}

ModelTexture EigenTexture::pack_images() const {
  ModelTexture texture{
      .sampler = "EigenTextures",
      .kind = TextureKind::k2DArray,
      .format = format_of(images_.precision),
      .width = frame_.width,
      .height = frame_.height,
      .depth = static_cast<int>(frame_.views.size()) * words_for(images_.values())};
  texture.data =
      images_.precision == Precision::k8Bit
          ? texture_data(in_layers(images_.codes, frame_.texel_count(), images_.values()))
          : texture_data(in_layers(images_.halves, frame_.texel_count(), images_.values()));
  return texture;
}

// The texel's part for one view, written out: a component's colour may begin in any lane.
std::string EigenTexture::texel_source() const {
  const int layers = words_for(images_.values());
  const auto lane = [](int value) {
    return fmt::format("part{}.{}", value / kLanes, "xyzw"[value % kLanes]);
  };
  std::string source = "vec3 eigen_texture_of(ivec2 texel, EigenMix mixed, int i) {\n";
  for (int layer = 0; layer < layers; ++layer)
    source += fmt::format(
        "  vec4 part{0} = texelFetch(EigenTextures, ivec3(texel, mixed.views[i] * {1} + {0}), "
        "0);\n",
        layer,
        layers);
  source += "  vec3 sum = vec3(0.0);\n";
  for (int c = 0; c < images_.components; ++c) {
    std::string colour =
        fmt::format("vec3({}, {}, {})", lane(3 * c), lane(3 * c + 1), lane(3 * c + 2));
    if (images_.precision == Precision::k8Bit)
      colour =
          fmt::format("({} - {}.0 / 255.0)", colour, images_.zeros[static_cast<std::size_t>(c)]);
    source += fmt::format("  sum += mixed.weights[{} * i + {}].{} * {};\n",
                          words_for(images_.components),
                          c / kLanes,
                          "xyzw"[c % kLanes],
                          colour);
  }
  return source + "  return sum;\n}\n";
}

ModelShader EigenTexture::shader() const {
  const int words = words_for(images_.components);
  ModelShader shader;
  shader.source =
      fmt::format("const ivec2 kTexels = ivec2({}, {});\nconst int kWeightWords = {};\n",
                  frame_.width,
                  frame_.height,
                  words);
  shader.source += kElevatedConcentricGlsl;
  shader.source += kDirectionLookupGlsl;
  shader.source += kTexelAtGlsl;
  shader.source += kGlsl;
  shader.source += texel_source();
  shader.source +=
      "vec3 btf_radiance(vec2 uv, vec3 view, vec3 light) {\n"
      "  ivec2 texel = texel_at(uv);\n"
      "  EigenMix mixed = eigen_mix(view, light);\n"
      "  vec3 sum = vec3(0.0);\n"
      "  for (int i = 0; i < 3; ++i) sum += eigen_texture_of(texel, mixed, i);\n"
      "  return max(sum, 0.0);\n"
      "}\n";
  shader.textures.push_back(pack_weights());
  shader.textures.push_back(pack_images());
  views_.add_textures("View", shader.textures);
  lights_.add_textures("Light", shader.textures);
  shader.fetches = 2 * DirectionLookup::kFetches + 9 * words + 3 * words_for(images_.values());
  return shader;
}

}  // namespace

Result<std::unique_ptr<Material>> fit_eigen_texture(const SampleSet& set,
                                                    const FitOptions& options,
                                                    Progress& progress) {
  VENEER_TRY(options.check());
  VENEER_TRY(refuse_mip_levels(options, kName));
  VENEER_TRY(refuse_form(options, kName));
  VENEER_ASSIGN(const int components, parse_one_term(options.components, kName));
  VENEER_ASSIGN(const Precision precision,
                parse_precision(options.precision, Precision::k8Bit, kName));
  VENEER_ASSIGN(const FittedPairs pairs, FittedPairs::of(set.info(), options.region));
  const MaterialFrame& frame = pairs.frame();
  VENEER_TRY(check_textures(frame, components, precision, Errc::kInvalidOption, "fit"));
  VENEER_TRY(set.check_finite());
  EigenImages images = fit_eigen_images(set, pairs, components, precision, progress);
  return std::make_unique<EigenTexture>(frame, std::move(images));
}

Result<std::unique_ptr<Material>> load_eigen_texture(const SafetensorsFile& file) {
  const std::string doing = fmt::format("reading {}", file.path().string());
  VENEER_ASSIGN(MaterialFrame frame, read_frame(file));
  EigenImages images;
  VENEER_ASSIGN(images.components, read_integer(file, "components", 1, kMostComponents));
  VENEER_ASSIGN(images.precision, read_precision(file, kName));
  VENEER_TRY(check_textures(frame, images.components, images.precision, Errc::kBadFormat, doing));
  const auto views = static_cast<std::int64_t>(frame.views.size());
  const std::vector<std::int64_t> shape{views, frame.texel_count(), images.components, 3};
  VENEER_ASSIGN(
      images.weights,
      read_halves(file,
                  "weights",
                  {views, static_cast<std::int64_t>(frame.lights.size()), images.components}));
  if (images.precision == Precision::kFloat16) {
    VENEER_ASSIGN(images.halves, read_halves(file, "eigen_textures", shape));
    return std::make_unique<EigenTexture>(std::move(frame), std::move(images));
  }
  VENEER_ASSIGN(const TensorView codes, file.tensor("eigen_textures", DType::kU8, shape));
  VENEER_ASSIGN(const TensorView zeros, file.tensor("zeros", DType::kU8, {images.components}));
  std::ranges::copy(codes.as<std::uint8_t>(), std::back_inserter(images.codes));
  std::ranges::copy(zeros.as<std::uint8_t>(), std::back_inserter(images.zeros));
  if (std::ranges::max(images.zeros) > EigenImages::kMostZero)
    return fail(Errc::kBadFormat,
                "{}: zeros: {} is over {}",
                doing,
                std::ranges::max(images.zeros),
                EigenImages::kMostZero);
  return std::make_unique<EigenTexture>(std::move(frame), std::move(images));
}

}  // namespace veneer::btf
