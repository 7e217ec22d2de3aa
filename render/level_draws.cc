// SPDX-License-Identifier: Apache-2.0
#include "render/level_draws.h"

#include <algorithm>
#include <optional>
#include <utility>

namespace veneer::render {
namespace {

constexpr std::size_t kFullRaster = 0;  // of the targets

// Whose error it is; of one level alone there is no doubt.
tl::unexpected<Error> of_level(std::span<const Level> levels,
                               std::size_t index,
                               const Error& error) {
  if (levels.size() == 1) return tl::unexpected<Error>(error);
  return fail_while(fmt::format("making level {} of 0 to {} ({})",
                                index,
                                levels.size() - 1,
                                levels[index].material->model()),
                    error);
}

DrawOptions draw_options(const Level& level) {
  return {.cache = level.drawing.cache,
          .filter = texel_filter(*level.material, level.drawing.average_texels),
          .evaluation = level.drawing.evaluation,
          .scale = level.drawing.scale};
}

}  // namespace

LevelDraws::LevelDraws(DrawTarget full, FadeMask mask, UpsamplePass upsample)
    : mask_(std::move(mask)), upsample_(std::move(upsample)) {
  targets_.push_back(std::move(full));
}

Result<LevelDraws> LevelDraws::create(const Scene& scene,
                                      std::span<const Level> levels,
                                      const calibration::ProjectorProfile& profile) {
  VENEER_CHECK(!levels.empty());
  VENEER_ASSIGN(DrawTarget full,
                DrawTarget::create({profile.geometry.width, profile.geometry.height}));
  VENEER_ASSIGN(FadeMask mask, FadeMask::create());
  VENEER_ASSIGN(UpsamplePass upsample, UpsamplePass::create());
  LevelDraws draws(std::move(full), std::move(mask), std::move(upsample));
  std::vector<std::optional<DrawPass>> passes(levels.size());
  for (std::size_t i = 0; i < levels.size(); ++i) {
    VENEER_CHECK(levels[i].material != nullptr);
    if (passes[i]) continue;
    // Making a material's shader packs all its textures: once for all levels that draw it.
    const btf::ModelShader shader = levels[i].material->shader();
    for (std::size_t k = i; k < levels.size(); ++k) {
      if (levels[k].material != levels[i].material) continue;
      if (const Status status = levels[k].drawing.check(); !status)
        return of_level(levels, k, status.error());
      auto pass = DrawPass::create(shader,
                                   scene.lights,
                                   scene.texture_repeats,
                                   profile,
                                   draw_options(levels[k]),
                                   k == i ? nullptr : passes[i]->textures());
      if (!pass) return of_level(levels, k, pass.error());
      passes[k] = std::move(*pass);
    }
  }
  for (std::optional<DrawPass>& pass : passes) {
    DrawnLevel level{std::move(*pass), kFullRaster};
    VENEER_TRY(draws.add_target(level));
    draws.levels_.push_back(std::move(level));
  }
  return draws;
}

// What a level draws on: a target of its raster, which others may have too.
Status LevelDraws::add_target(DrawnLevel& level) {
  const auto found = std::ranges::find_if(
      targets_, [&](const DrawTarget& target) { return target.size() == level.pass.raster(); });
  level.target = static_cast<std::size_t>(found - targets_.begin());
  if (found != targets_.end()) return {};
  VENEER_ASSIGN(DrawTarget target, DrawTarget::create(level.pass.raster()));
  targets_.push_back(std::move(target));
  return {};
}

void LevelDraws::warm_up(const MeshBuffers& mesh) const {
  FrameInput input;
  input.eye_in_world = {0, 0, 1};
  for (std::size_t i = 0; i < levels_.size(); ++i) {
    input.level = i;
    input.next_level = (i + 1) % levels_.size();
    for (const double fade : {0.0, 0.5}) {
      input.fade = fade;
      draw(mesh, input);
    }
  }
  clear();
  glFinish();
}

void LevelDraws::set_projector(const calibration::ProjectorProfile& profile) {
  for (DrawnLevel& level : levels_) level.pass.set_projector(profile);
}

void LevelDraws::draw(const MeshBuffers& mesh, const FrameInput& input) const {
  VENEER_CHECK(input.level < levels_.size() && input.next_level < levels_.size());
  const DrawnLevel& level = levels_[input.level];
  const DrawnLevel& next = levels_[input.next_level];
  const DrawInput at{input.eye_in_world, input.world_from_object, input.specular_weight};
  const auto fade = static_cast<float>(input.fade);
  if (&level == &next || fade <= 0.0F) {
    draw_alone(level, mesh, at);
  } else if (fade >= 1.0F) {
    draw_alone(next, mesh, at);
  } else if (level.target == next.target) {
    draw_on_one(level, next, fade, mesh, at);
  } else {
    draw_on_two(level, next, fade, mesh, at);
  }
}

void LevelDraws::draw_alone(const DrawnLevel& level,
                            const MeshBuffers& mesh,
                            const DrawInput& input) const {
  const DrawTarget& drawn = targets_[level.target];
  level.pass.draw(drawn.framebuffer(), mesh, input);
  if (level.target != kFullRaster) upsample_.run(drawn, target());
}

FadeMask::Raster LevelDraws::raster_of(const DrawTarget& drawn) const {
  return {drawn.size(),
          target().size().cast<float>().cwiseQuotient(drawn.size().cast<float>()),
          {0, 0}};
}

void LevelDraws::draw_on_one(const DrawnLevel& level,
                             const DrawnLevel& next,
                             float fade,
                             const MeshBuffers& mesh,
                             const DrawInput& input) const {
  const DrawTarget& drawn = targets_[level.target];
  const FadeMask::Raster raster = raster_of(drawn);
  drawn.clear_colour();
  level.pass.draw(drawn.framebuffer(), mesh, input, {mask_, {fade, false}, raster});
  next.pass.draw(drawn.framebuffer(), mesh, input, {mask_, {fade, true}, raster});
  if (level.target != kFullRaster) upsample_.run(drawn, target());
}

void LevelDraws::draw_on_two(const DrawnLevel& level,
                             const DrawnLevel& next,
                             float fade,
                             const MeshBuffers& mesh,
                             const DrawInput& input) const {
  for (const DrawnLevel* one : {&level, &next}) {
    const DrawTarget& drawn = targets_[one->target];
    FadeMask::Raster raster = raster_of(drawn);
    // Interpolation reads one pixel beyond the part.
    if (one->target != kFullRaster) raster.reach = raster.pixels;
    drawn.clear_colour();
    one->pass.draw(drawn.framebuffer(), mesh, input, {mask_, {fade, one == &next}, raster});
  }
  for (const DrawnLevel* one : {&level, &next}) {
    if (one->target != kFullRaster)
      upsample_.run(targets_[one->target], target(), {fade, one == &next});
  }
}

}  // namespace veneer::render
