// SPDX-License-Identifier: Apache-2.0
#include "cli/commands/render_from_eye.h"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "base/exit_code.h"
#include "base/image_files.h"
#include "cli/report/pictures.h"

namespace veneer::cli {
namespace {

// Of the object's pixels, which may be brighter than white: highlights that would leave the rest
// dark.
constexpr double kBrighter = 0.01;
// Shells have one thickness; where texels differ by more than this their height is not to scale.
constexpr double kMostSpread = 2.0;

// The luminance that all but the brightest hundredth of the object keeps below, cd/m^2.
double white_of(const render::EyePicture& picture) {
  std::vector<float> luminances;
  for (std::size_t i = 0; i < picture.hidden.pixels().size(); ++i)
    if (picture.hidden.pixels()[i] > 0.0F)
      luminances.push_back(picture.radiance_xyz.pixels()[i].y());
  if (luminances.empty()) return 1.0;
  const auto at =
      static_cast<std::ptrdiff_t>((1 - kBrighter) * static_cast<double>(luminances.size() - 1));
  std::ranges::nth_element(luminances, luminances.begin() + at);
  const double white = double(luminances[static_cast<std::size_t>(at)]);
  return white > 0.0 ? white : 1.0;
}

Status write(const render::EyePicture& picture, const RenderFromEyeOptions& options, double white) {
  if (options.out.extension() == ".png") {
    const Image<Rgb8> shown = picture_of_xyz(picture.radiance_xyz.view(), white);
    return write_png(options.out, shown.view());
  }
  std::vector<ExrChannel> channels;
  const char* const names[] = {"X", "Y", "Z", "A"};
  for (int c = 0; c < 4; ++c) {
    Image<float> channel(picture.hidden.width(), picture.hidden.height());
    for (std::size_t i = 0; i < channel.pixels().size(); ++i)
      channel.pixels()[i] =
          c < 3 ? picture.radiance_xyz.pixels()[i][c] : picture.hidden.pixels()[i];
    channels.push_back({names[c], std::move(channel)});
  }
  return write_exr(options.out, channels);
}

}  // namespace

Result<int> render_from_eye(const render::Scene& scene,
                            const btf::Material& material,
                            const RenderFromEyeOptions& options,
                            CommandLine& line) {
  if (!(options.white_nits >= 0.0) || !std::isfinite(options.white_nits))
    return fail(
        Errc::kInvalidOption,
        "--white {}: expected the luminance that is shown as white, in cd/m^2, or 0 to have "
        "it found",
        options.white_nits);
  VENEER_ASSIGN(const render::EyePicture picture,
                render::draw_from_eye(scene, material, options.view));
  const double white = options.white_nits > 0.0 ? options.white_nits : white_of(picture);
  VENEER_TRY(write(picture, options, white));
  nlohmann::ordered_json json{{"picture", options.out.string()}, {"white_nits", white}};
  std::string text = fmt::format("wrote {}", options.out.string());
  if (options.out.extension() == ".png") text += fmt::format(": white is {:.4g} cd/m^2", white);
  if (picture.texel) {
    const render::TexelSize& texel = *picture.texel;
    json["texel_mm"] = {
        {"mean", 1e3 * texel.mean_m}, {"low", 1e3 * texel.low_m}, {"high", 1e3 * texel.high_m}};
    text += fmt::format("; a texel is {:.3g} mm ({:.3g} to {:.3g})",
                        1e3 * texel.mean_m,
                        1e3 * texel.low_m,
                        1e3 * texel.high_m);
    if (texel.high_m > kMostSpread * texel.low_m)
      line.note(
          fmt::format("texels are {:.3g} to {:.3g} mm large on the object, and shells everywhere "
                      "as high as the "
                      "mean, {:.3g} mm, says: unwrap the mesh more evenly to have them to scale",
                      1e3 * texel.low_m,
                      1e3 * texel.high_m,
                      1e3 * texel.mean_m));
  }
  line.print(json, text);
  return kExitDone;
}

}  // namespace veneer::cli
