// SPDX-License-Identifier: Apache-2.0
#include "simulation/bench/object_view.h"

#include "base/parallel.h"
#include "simulation/bench/board_view.h"

namespace veneer::simulation {

ObjectView::ObjectView(const Bench& bench,
                       const CameraTruth& camera,
                       const RigidTransform& world_from_object)
    : width_(camera.width), height_(camera.height) {
  const RadialDistortion lens = distortion_of(camera);
  const std::vector<Eigen::Vector2d> places = ray_places(camera.samples * camera.samples);
  part_of_ray_ = 1.0F / static_cast<float>(places.size());
  const RigidTransform& world_from_camera = camera.world_from_camera;

  std::vector<std::vector<Sample>> rows(static_cast<std::size_t>(height_));
  const auto width = static_cast<std::size_t>(width_);
  first_.assign(width * rows.size() + 1, 0);
  const auto see = [&](int x, int y, std::vector<Sample>& row) {
    for (const Eigen::Vector2d& place : places) {
      const Eigen::Vector2d pixel(x + place.x(), y + place.y());
      const Eigen::Vector2d slope =
          lens.undistorted((pixel - camera.principal_point) / camera.focal_px);
      const auto met = bench.trace(world_from_object,
                                   world_from_camera.translation,
                                   world_from_camera.rotation * slope.homogeneous());
      if (met) row.push_back({met->raster_pixel, part_of_ray_ * met->geometry, met->painted});
    }
  };
  parallel_for(height_, 8, [&](std::int64_t begin, std::int64_t end) {
    for (auto y = static_cast<std::size_t>(begin); y < static_cast<std::size_t>(end); ++y)
      for (int x = 0; x < width_; ++x) {
        see(x, static_cast<int>(y), rows[y]);
        first_[y * width + static_cast<std::size_t>(x) + 1] =
            static_cast<std::uint32_t>(rows[y].size());  // within the row, for now
      }
  });
  for (std::size_t y = 0; y < rows.size(); ++y) {
    const auto before = static_cast<std::uint32_t>(samples_.size());
    for (std::size_t x = 0; x < width; ++x) first_[y * width + x + 1] += before;
    samples_.insert(samples_.end(), rows[y].begin(), rows[y].end());
  }
}

Image<Rgb32f> ObjectView::gather(const OnObject<Image<Rgb32f>>& raster,
                                 float lamp,
                                 const OnObject<Rgb32f>& ambient) const {
  Image<Rgb32f> picture(width_, height_);
  const auto width = static_cast<std::size_t>(width_);
  parallel_for(height_, 16, [&](std::int64_t begin, std::int64_t end) {
    for (std::size_t pixel = static_cast<std::size_t>(begin) * width;
         pixel < static_cast<std::size_t>(end) * width;
         ++pixel) {
      Rgb32f sum = Rgb32f::Zero();
      for (std::uint32_t i = first_[pixel]; i < first_[pixel + 1]; ++i) {
        const Sample& sample = samples_[i];
        const std::size_t side = sample.painted ? 1 : 0;
        sum += part_of_ray_ * ambient[side];
        if (sample.raster_pixel < 0) continue;
        sum += lamp * sample.geometry *
               raster[side].pixels()[static_cast<std::size_t>(sample.raster_pixel)];
      }
      picture.pixels()[pixel] = sum;
    }
  });
  return picture;
}

}  // namespace veneer::simulation
