// SPDX-License-Identifier: Apache-2.0
#include "capture/development/testing/rendered_board.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>

#include "base/image_files.h"
#include "base/parallel.h"
#include "base/random.h"
#include "capture/development/rectification.h"

namespace veneer::capture::testing {
namespace {

constexpr double kBoardPixelsPerMm = 40;

/// r with r (1 + k1 r^2 + k2 r^4) = bent, by bisection.
double unbend(const CameraLens& lens, double bent) {
  if (lens.k1 == 0 && lens.k2 == 0) return bent;
  double low = 0;
  double high = 4 * bent + 1e-9;
  for (int i = 0; i < 40; ++i) {
    const double r = (low + high) / 2;
    (r * (1 + lens.k1 * r * r + lens.k2 * r * r * r * r) < bent ? low : high) = r;
  }
  return (low + high) / 2;
}

Image<float> blurred(const Image<float>& sharp, double sigma) {
  if (!(sigma > 0)) return sharp;
  const int reach = static_cast<int>(std::ceil(4 * sigma));
  std::vector<double> kernel;
  for (int i = -reach; i <= reach; ++i) kernel.push_back(std::exp(-0.5 * i * i / (sigma * sigma)));
  Image<float> source = sharp;
  Image<float> result(sharp.width(), sharp.height());
  for (const bool along_x : {true, false}) {
    for (int y = 0; y < sharp.height(); ++y) {
      for (int x = 0; x < sharp.width(); ++x) {
        double sum = 0;
        double total = 0;
        for (int i = -reach; i <= reach; ++i) {
          const int xx = std::clamp(along_x ? x + i : x, 0, sharp.width() - 1);
          const int yy = std::clamp(along_x ? y : y + i, 0, sharp.height() - 1);
          sum += kernel[static_cast<std::size_t>(i + reach)] * source(xx, yy);
          total += kernel[static_cast<std::size_t>(i + reach)];
        }
        result(x, y) = static_cast<float>(sum / total);
      }
    }
    source = result;
  }
  return result;
}

}  // namespace

MergedPicture render(const BoardScene& scene) {
  const Image<std::uint8_t> drawn = draw_board(scene.board, kBoardPixelsPerMm).value();
  const RigidTransform board_from_camera = scene.camera_from_board.inverse();
  const Eigen::Vector3d eye = board_from_camera.translation * 1000;
  const auto light_along = [&](const Eigen::Vector3d& ray) {
    const double front = scene.in_front(eye, ray);
    if (front >= 0) return front;
    const double way = -eye.z() / ray.z();
    if (!(way > 0)) return scene.surroundings;
    const Eigen::Vector2d place = (eye + way * ray).head<2>();
    const double cover = scene.cover(place);
    if (cover >= 0) return cover;
    const Eigen::Vector2d pixel = place * kBoardPixelsPerMm;
    if (!(pixel.x() >= 0 && pixel.y() >= 0 && pixel.x() < drawn.width() &&
          pixel.y() < drawn.height()))
      return scene.surroundings;
    return drawn(static_cast<int>(pixel.x()), static_cast<int>(pixel.y())) > 0 ? scene.white
                                                                               : scene.black;
  };
  Image<float> sharp(scene.width, scene.height);
  parallel_for(scene.height, 8, [&](std::int64_t begin, std::int64_t end) {
    for (int y = static_cast<int>(begin); y < end; ++y) {
      for (int x = 0; x < scene.width; ++x) {
        double sum = 0;
        for (int i = 0; i < scene.samples * scene.samples; ++i) {
          const Eigen::Vector2d pixel(x + (i % scene.samples + 0.5) / scene.samples,
                                      y + (i / scene.samples + 0.5) / scene.samples);
          const Eigen::Vector2d bent =
              (pixel - scene.lens.principal_point).cwiseQuotient(scene.lens.focal_px);
          const double r = bent.norm();
          const Eigen::Vector2d plane =
              r > 0 ? Eigen::Vector2d(bent * unbend(scene.lens, r) / r) : bent;
          sum += light_along(board_from_camera.rotation *
                             Eigen::Vector3d(plane.x(), plane.y(), 1).normalized());
        }
        sharp(x, y) = static_cast<float>(sum / (scene.samples * scene.samples));
      }
    }
  });
  const Image<float> soft = blurred(sharp, scene.blur_px);
  MergedPicture picture{.light = Image<Rgb32f>(scene.width, scene.height),
                        .variance = Image<Rgb32f>(scene.width, scene.height),
                        .saturated = Image<std::uint8_t>(scene.width, scene.height)};
  Pcg32 random(scene.seed);
  const double corner2 = 0.25 * (scene.width * scene.width + scene.height * scene.height);
  for (int y = 0; y < scene.height; ++y) {
    for (int x = 0; x < scene.width; ++x) {
      const double r2 =
          std::pow(x + 0.5 - 0.5 * scene.width, 2) + std::pow(y + 0.5 - 0.5 * scene.height, 2);
      const double fall_off = 1 - scene.vignetting * r2 / corner2;
      for (int channel = 0; channel < 3; ++channel) {
        picture.light(x, y)[channel] =
            static_cast<float>(soft(x, y) * fall_off + scene.noise * random.normal());
        picture.variance(x, y)[channel] = static_cast<float>(scene.noise * scene.noise);
      }
    }
  }
  return picture;
}

RigidTransform camera_at(const Eigen::Vector2d& place_mm,
                         double distance_mm,
                         double theta_rad,
                         double phi_rad,
                         double roll_rad) {
  const Eigen::Vector3d direction = flip_local({std::sin(theta_rad) * std::cos(phi_rad),
                                                std::sin(theta_rad) * std::sin(phi_rad),
                                                std::cos(theta_rad)});
  const Eigen::Vector3d place(place_mm.x() / 1000, place_mm.y() / 1000, 0);
  const RigidTransform board_from_camera =
      look_at(place + direction * (distance_mm / 1000), place, Eigen::Vector3d(0, -1, 0));
  const RigidTransform roll{
      Eigen::Quaterniond(Eigen::AngleAxisd(roll_rad, Eigen::Vector3d::UnitZ())),
      Eigen::Vector3d::Zero()};
  return roll * board_from_camera.inverse();
}

void show(const MergedPicture& picture, const std::string& name) {
  const char* folder = std::getenv("VENEER_TEST_PICTURES");
  if (folder == nullptr) return;
  Image<Rgb8> bytes(picture.light.width(), picture.light.height());
  for (std::size_t i = 0; i < bytes.pixels().size(); ++i)
    for (int channel = 0; channel < 3; ++channel)
      bytes.pixels()[i][static_cast<std::size_t>(channel)] = static_cast<std::uint8_t>(
          255 * std::pow(std::clamp(picture.light.pixels()[i][channel], 0.0F, 1.0F), 1 / 2.2F));
  (void)write_png(std::filesystem::path(folder) / (name + ".png"), bytes.view());
}

}  // namespace veneer::capture::testing
