// SPDX-License-Identifier: Apache-2.0
#include "btf/models/material_tensors.h"

#include <algorithm>
#include <charconv>
#include <utility>

#include "btf/internal_sample_set.h"

namespace veneer::btf {
namespace {

Result<DirectionSet> read_directions_of(const SafetensorsFile& file, const std::string& name) {
  VENEER_ASSIGN(const TensorView tensor, file.tensor(name, DType::kF64, {-1, 3}));
  const std::span<const double> values = tensor.as<double>();
  DirectionSet directions;
  for (std::size_t i = 0; i + 3 <= values.size(); i += 3)
    directions.emplace_back(values[i], values[i + 1], values[i + 2]);
  return directions;
}

Material::Contents::Tensor directions_tensor(const std::string& name,
                                             const DirectionSet& directions) {
  return {{name, DType::kF64, {static_cast<std::int64_t>(directions.size()), 3}},
          std::as_bytes(std::span(directions))};
}

constexpr const char* kBoxes = "boxes";
// [views, lights][u_min, u_max, v_min, v_max]
constexpr std::size_t kBoxValues = 8;
static_assert(sizeof(DirectionBoxes) == kBoxValues * sizeof(double));

}  // namespace

MaterialFrame frame_of(const SampleSetInfo& info) {
  return {info.width, info.height, info.views, info.lights};
}

void add_frame(const MaterialFrame& frame, Material::Contents& contents) {
  contents.metadata["width"] = fmt::format("{}", frame.width);
  contents.metadata["height"] = fmt::format("{}", frame.height);
  contents.tensors.push_back(directions_tensor("views", frame.views));
  contents.tensors.push_back(directions_tensor("lights", frame.lights));
}

Result<MaterialFrame> read_frame(const SafetensorsFile& file) {
  SampleSetInfo info;
  VENEER_ASSIGN(info.width, read_integer(file, "width", 1, kMostTextureSide));
  VENEER_ASSIGN(info.height, read_integer(file, "height", 1, kMostTextureSide));
  VENEER_ASSIGN(info.views, read_directions_of(file, "views"));
  VENEER_ASSIGN(info.lights, read_directions_of(file, "lights"));
  VENEER_TRY(internal::check_info(
      info, Errc::kBadFormat, fmt::format("reading {}", file.path().string())));
  return frame_of(info);
}

void add_boxes(const DirectionBoxes& boxes, Material::Contents& contents) {
  if (boxes.views.is_all() && boxes.lights.is_all()) return;
  contents.tensors.push_back({{kBoxes, DType::kF64, {2, 4}}, std::as_bytes(std::span(&boxes, 1))});
}

Result<DirectionBoxes> read_boxes(const SafetensorsFile& file) {
  DirectionBoxes boxes;
  if (!file.contains(kBoxes)) return boxes;
  VENEER_ASSIGN(const TensorView tensor, file.tensor(kBoxes, DType::kF64, {2, 4}));
  const std::span<const double> values = tensor.as<double>();
  boxes = {{values[0], values[1], values[2], values[3]},
           {values[4], values[5], values[6], values[7]}};
  for (const auto& [what, box] : {std::pair{"views", &boxes.views}, {"lights", &boxes.lights}})
    if (const Status status = box->check(what); !status)
      return fail(Errc::kBadFormat, "reading {}: {}", file.path().string(), status.error().what);
  return boxes;
}

Status check_texture(std::string_view what,
                     std::int64_t width,
                     std::int64_t height,
                     Errc code,
                     std::string_view doing) {
  if (width <= kMostTextureSide && height <= kMostTextureSide) return {};
  return fail(code,
              "{}: {} would take a texture of {} x {}, over {} a side; crop the sample or choose "
              "fewer components",
              doing,
              what,
              width,
              height,
              kMostTextureSide);
}

Result<int> read_integer(const SafetensorsFile& file, const std::string& key, int least, int most) {
  VENEER_ASSIGN(const std::string text, file.meta(key));
  int value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size() || value < least || value > most)
    return fail(Errc::kBadFormat,
                "reading {}: {} is \"{}\"; it should be {} to {}",
                file.path().string(),
                key,
                text,
                least,
                most);
  return value;
}

Result<std::vector<Eigen::half>> read_halves(const SafetensorsFile& file,
                                             const std::string& name,
                                             const std::vector<std::int64_t>& shape) {
  VENEER_ASSIGN(const TensorView tensor, file.tensor(name, DType::kF16, shape));
  const std::span<const Eigen::half> values = tensor.as<Eigen::half>();
  const auto bad =
      std::ranges::find_if_not(values, [](Eigen::half h) { return Eigen::numext::isfinite(h); });
  if (bad != values.end())
    return fail(Errc::kBadFormat,
                "reading {}: {}: element {} is not finite",
                file.path().string(),
                name,
                bad - values.begin());
  return std::vector<Eigen::half>(values.begin(), values.end());
}

Result<std::vector<std::uint8_t>> read_clusters(const SafetensorsFile& file,
                                                const std::string& name,
                                                int texels,
                                                int clusters) {
  VENEER_ASSIGN(const TensorView tensor, file.tensor(name, DType::kU8, {texels}));
  const std::span<const std::uint8_t> values = tensor.as<std::uint8_t>();
  const auto bad =
      std::ranges::find_if(values, [clusters](std::uint8_t k) { return k >= clusters; });
  if (bad != values.end())
    return fail(Errc::kBadFormat,
                "reading {}: {}: texel {} is in cluster {} of {}",
                file.path().string(),
                name,
                bad - values.begin(),
                *bad,
                clusters);
  return std::vector<std::uint8_t>(values.begin(), values.end());
}

Eigen::half saturated_half(float value) {
  constexpr float kLargest = 65504.0F;
  return Eigen::half(std::clamp(value, -kLargest, kLargest));
}

}  // namespace veneer::btf
