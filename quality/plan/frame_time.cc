// SPDX-License-Identifier: Apache-2.0
#include "quality/plan/frame_time.h"

#include <array>
#include <chrono>

#include "base/statistics.h"
#include "quality/viewpoints.h"
#include "render/renderer.h"

namespace veneer::quality {
namespace {

constexpr int kWarmUp = 2;
constexpr int kFrames = 9;

}  // namespace

Result<double> draw_ms(const render::Scene& scene,
                       const calibration::ProjectorProfile& profile,
                       const btf::Material& material) {
  VENEER_ASSIGN(const std::vector<Viewpoint> places, viewpoints_of(scene, kWarmUp + kFrames));
  VENEER_ASSIGN(
      const std::unique_ptr<render::Renderer> renderer,
      render::Renderer::create(scene, std::array{render::Level{&material, {}}}, profile, {}));
  std::vector<double> times;
  for (std::size_t i = 0; i < places.size(); ++i) {
    const auto begin = std::chrono::steady_clock::now();
    renderer->draw({places[i].eye_in_world, places[i].world_from_object});
    renderer->finish();
    const std::chrono::duration<double, std::milli> whole =
        std::chrono::steady_clock::now() - begin;
    // Without a timer in the GPU, compensation is counted in: rather too much than too little.
    if (i >= kWarmUp) times.push_back(renderer->statistics().draw_ms.value_or(whole.count()));
  }
  return quantile(std::move(times), 0.5);
}

}  // namespace veneer::quality
