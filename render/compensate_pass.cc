// SPDX-License-Identifier: Apache-2.0
#include "render/compensate_pass.h"

#include <algorithm>
#include <array>
#include <utility>
#include <vector>

namespace veneer::render {
namespace {

constexpr char kFullscreenVert[] =
#include "render/shaders/fullscreen.vert.inc"
    ;
constexpr char kCompensateFrag[] =
#include "render/shaders/compensate.frag.inc"
    ;
constexpr char kCountComp[] =
#include "render/shaders/count.comp.inc"
    ;
constexpr std::string_view kVersion = "#version 450 core\n";
// Pixels that one work group of count.comp takes: 8 x 8 invocations with tiles of 16 x 8.
constexpr int kGroupWidth = 128;
constexpr int kGroupHeight = 64;
constexpr int kLevelsWidth = 1024;        // of the texture of levels
constexpr std::size_t kCounterCount = 6;  // of the block Counters
constexpr double kLossUnit = 1.0 / 32.0;  // of the loss in the codes' alpha

// The block Compensation of compensate.frag.
struct ConstantsBlock {
  Eigen::Matrix4f drive_from_target;
  Eigen::Matrix4f cones_from_target;
  Eigen::Matrix4f drive_from_cones;
  Eigen::Matrix4f cones_from_drive;
  Eigen::Vector4f drive_of_ambient;
  Eigen::Vector4f drive_of_black;
  Eigen::Vector4f drive_of_white;
  Eigen::Vector4i first_level;
  Eigen::Vector4i level_count;
  float geometry_floor;
  float gamut_tolerance;
  float dither;
  std::int32_t gamut_steps;
  Eigen::Vector4f correction_full;
  Eigen::Vector4i correction_axes;
  Eigen::Vector4f nits;
  float ceiling_limit;
  std::int32_t ceiling_steps;
  std::int32_t code_count;
  std::int32_t last_residual_node;
};
static_assert(sizeof(ConstantsBlock) == 4 * 64 + 10 * 16);

Eigen::Matrix4f padded(const Eigen::Matrix3d& m) {
  Eigen::Matrix4f result = Eigen::Matrix4f::Identity();
  result.topLeftCorner<3, 3>() = m.cast<float>();
  return result;
}
Eigen::Vector4f padded(const Eigen::Vector3d& v) {
  return Eigen::Vector4d(v.x(), v.y(), v.z(), 0).cast<float>();
}

ConstantsBlock block_of(const Compensation& compensation) {
  const Compensation::Constants& c = compensation.constants();
  ConstantsBlock block{};
  block.drive_from_target = padded(c.drive_from_target);
  block.cones_from_target = padded(c.cones_from_target);
  block.drive_from_cones = padded(c.drive_from_cones);
  block.cones_from_drive = padded(c.cones_from_drive);
  block.drive_of_ambient = padded(c.drive_of_ambient);
  block.drive_of_black = padded(c.drive_of_black);
  block.drive_of_white = padded(c.drive_of_white);
  int first = 0;
  for (int i = 0; i < 3; ++i) {
    const auto count =
        static_cast<int>(compensation.tone_levels()[static_cast<std::size_t>(i)].levels().size());
    block.first_level[i] = first;
    block.level_count[i] = count;
    first += count;
  }
  block.geometry_floor = static_cast<float>(c.geometry_floor);
  block.gamut_tolerance = static_cast<float>(kGamutTolerance);
  block.dither = c.dither ? 1.0F : 0.0F;
  block.gamut_steps = kGamutSteps;
  const calibration::DriveCorrection& correction = compensation.correction();
  const calibration::DriveCorrection::Axes& axes = correction.axes();
  block.correction_full = padded(axes.full);
  block.correction_axes = {axes.steps, axes.below, correction.nodes() - 1, 0};
  const LuminanceCeiling& ceiling = compensation.ceiling();
  block.nits = padded(ceiling.primaries_nits());
  block.nits.w() = static_cast<float>(ceiling.black_nits());
  block.ceiling_limit = static_cast<float>(ceiling.limit());
  block.ceiling_steps = kCeilingSteps;
  block.code_count = static_cast<std::int32_t>(ceiling.tone_curves()[0].size());
  block.last_residual_node = std::max(ceiling.residual().nodes() - 1, 0);
  return block;
}

// One row for each channel; the texel says where its piece's level is.
GlTexture upload_seeds(const Compensation& compensation) {
  GlTexture texture = make_texture_2d(GL_RG16UI, ToneLevels::kSeeds, 3);
  for (int i = 0; i < 3; ++i) {
    const auto seeds = compensation.tone_levels()[static_cast<std::size_t>(i)].seeds();
    glTextureSubImage2D(texture.id(),
                        0,
                        0,
                        i,
                        ToneLevels::kSeeds,
                        1,
                        GL_RG_INTEGER,
                        GL_UNSIGNED_SHORT,
                        seeds.data());
  }
  return texture;
}

// A list in rows of kLevelsWidth, with room for every code of three channels, so that its size
// depends on the bits alone (see warm_up()).
template <class Texel>
GlTexture upload_rows(GLenum internal_format, GLenum format, int bits, std::vector<Texel> texels) {
  const int rows = ((3 << bits) + kLevelsWidth - 1) / kLevelsWidth;
  texels.resize(static_cast<std::size_t>(rows) * kLevelsWidth);
  GlTexture texture = make_texture_2d(internal_format, kLevelsWidth, rows);
  glTextureSubImage2D(texture.id(), 0, 0, 0, kLevelsWidth, rows, format, GL_FLOAT, texels.data());
  return texture;
}

// The levels of all channels one after the other.
GlTexture upload_levels(const PreparedProfile& profile) {
  std::vector<std::array<float, 2>> texels;
  for (const ToneLevels& tone : profile.compensation().tone_levels()) {
    for (std::size_t i = 0; i < tone.levels().size(); ++i)
      texels.push_back({tone.levels()[i], static_cast<float>(tone.codes()[i])});
  }
  return upload_rows(GL_RG32F, GL_RG, profile.profile().bits, std::move(texels));
}

// What every code sends, channels one after the other; none without a ceiling.
GlTexture upload_light(const PreparedProfile& profile) {
  const LuminanceCeiling& ceiling = profile.compensation().ceiling();
  if (!ceiling.active()) return {};
  std::vector<float> texels;
  for (const std::vector<double>& curve : ceiling.tone_curves())
    texels.insert(texels.end(), curve.begin(), curve.end());
  return upload_rows(GL_R32F, GL_RED, profile.profile().bits, std::move(texels));
}

// A table over a cube, along each axis `nodes`; alpha is padding.
GlTexture upload_cube(int nodes, const std::vector<Eigen::Vector3d>& values) {
  if (values.empty()) return {};
  std::vector<Eigen::Vector4f> texels;
  texels.reserve(values.size());
  for (const Eigen::Vector3d& value : values) texels.push_back(padded(value));
  GlTexture texture = make_texture(GL_TEXTURE_3D);
  glTextureStorage3D(texture.id(), 1, GL_RGBA32F, nodes, nodes, nodes);
  glTextureParameteri(texture.id(), GL_TEXTURE_MIN_FILTER, GL_NEAREST);
  glTextureParameteri(texture.id(), GL_TEXTURE_MAG_FILTER, GL_NEAREST);
  glTextureSubImage3D(
      texture.id(), 0, 0, 0, 0, nodes, nodes, nodes, GL_RGBA, GL_FLOAT, texels.data()->data());
  return texture;
}
GlTexture upload_correction(const calibration::DriveCorrection& correction) {
  return upload_cube(correction.nodes(), correction.values());
}

CompensateKind kind_of(const Compensation& compensation) {
  if (!compensation.constants().compensate) return CompensateKind::kNone;
  return compensation.correction().empty() ? CompensateKind::kPlain : CompensateKind::kResidual;
}

// A picture of floats, without padding.
template <class Pixel>
GlTexture upload_image(GLenum internal_format, GLenum format, const Image<Pixel>& image) {
  GlTexture texture = make_texture_2d(internal_format, image.width(), image.height());
  glTextureSubImage2D(texture.id(),
                      0,
                      0,
                      0,
                      image.width(),
                      image.height(),
                      format,
                      GL_FLOAT,
                      image.pixels().data());
  return texture;
}

GLsizei groups(int pixels, int per_group) { return (pixels + per_group - 1) / per_group; }

}  // namespace

std::string compensate_fragment_source(CompensateKind kind, bool has_ceiling) {
  return fmt::format("{}#define SEED_COUNT {}\n#define LEVELS_WIDTH {}\n{}{}{}{}",
                     kVersion,
                     ToneLevels::kSeeds,
                     kLevelsWidth,
                     kind != CompensateKind::kNone ? "#define COMPENSATE\n" : "",
                     kind == CompensateKind::kResidual ? "#define RESIDUAL\n" : "",
                     has_ceiling ? "#define CEILING\n" : "",
                     kCompensateFrag);
}
std::string fullscreen_vertex_source() { return std::string(kVersion) + kFullscreenVert; }
std::string count_compute_source() { return std::string(kVersion) + kCountComp; }

Status CompensatePass::link(CompensateKind kind) {
  Program& program = programs_[static_cast<std::size_t>(kind)];
  if (program.program.id() != 0) return {};
  VENEER_ASSIGN(program.program,
                link_program({{GL_VERTEX_SHADER, "fullscreen.vert", fullscreen_vertex_source()},
                              {GL_FRAGMENT_SHADER,
                               "compensate.frag",
                               compensate_fragment_source(kind, has_ceiling_)}}));
  program.seed_location = glGetUniformLocation(program.program.id(), "dither_seed");
  return {};
}

// Drivers finish compiling when a program first draws, some anew for each kind of texture that it
// reads (llvmpipe: whether a size is a power of two). So every kind of profile draws one pixel
// here, which the next run overwrites, from textures like those that it will have.
Status CompensatePass::warm_up() {
  const GlTexture target = make_texture_2d(GL_RGBA16F, width_, height_);
  const GlTexture even = make_texture_2d(GL_RGB32F, 1, 1);
  const GlTexture patterned = make_texture_2d(GL_RGB32F, width_, height_);
  const auto nothing = [](const Eigen::Vector3d&) { return Eigen::Vector3d(0, 0, 0); };
  const GlTexture correction = upload_correction(calibration::DriveCorrection(
      calibration::ColourResidual::sampled(2, nothing), calibration::DriveCorrection::kNodes));
  for (const CompensateKind kind : {CompensateKind::kPlain, CompensateKind::kResidual}) {
    VENEER_TRY(link(kind));
    const GLuint residual = kind == CompensateKind::kResidual ? correction.id() : 0;
    for (const GLuint reflectance : {even.id(), patterned.id()})
      compensate({kind, target.id(), reflectance, correction.id(), residual}, 0, 1, 1);
  }
  glFinish();
  return {};
}

CompensatePass::ProfileTextures CompensatePass::upload(const PreparedProfile& profile) {
  const Compensation& compensation = profile.compensation();
  const ConstantsBlock block = block_of(compensation);
  return {make_buffer(&block, sizeof(block), 0),
          upload_seeds(compensation),
          upload_levels(profile),
          upload_image(GL_R32F, GL_RED, profile.vignetting()),
          upload_image(GL_RGB32F, GL_RGB, profile.reflectance()),
          upload_correction(compensation.correction()),
          upload_light(profile),
          upload_cube(compensation.ceiling().residual().nodes(),
                      compensation.ceiling().residual().values())};
}

Status CompensatePass::set_profile(const PreparedProfile& profile) {
  VENEER_CHECK(profile.vignetting().width() == width_ && profile.vignetting().height() == height_);
  const CompensateKind kind = kind_of(profile.compensation());
  VENEER_CHECK((kind == CompensateKind::kNone) == (kind_ == CompensateKind::kNone));
  VENEER_CHECK(profile.compensation().ceiling().active() == has_ceiling_);
  VENEER_TRY(link(kind));
  profile_ = upload(profile);
  kind_ = kind;
  return {};
}

Result<CompensatePass> CompensatePass::create(const PreparedProfile& profile, bool exchangeable) {
  CompensatePass pass;
  pass.width_ = profile.vignetting().width();
  pass.height_ = profile.vignetting().height();
  pass.kind_ = kind_of(profile.compensation());
  pass.has_ceiling_ = profile.compensation().ceiling().active();
  VENEER_TRY(pass.link(pass.kind_));
  VENEER_ASSIGN(pass.count_program_,
                link_program({{GL_COMPUTE_SHADER, "count.comp", count_compute_source()}}));
  pass.profile_ = upload(profile);
  pass.codes_ = make_texture_2d(GL_RGBA16UI, pass.width_, pass.height_);
  pass.framebuffer_ = make_framebuffer();
  glNamedFramebufferTexture(pass.framebuffer_.id(), GL_COLOR_ATTACHMENT0, pass.codes_.id(), 0);
  pass.no_vertices_ = make_vertex_array();
  if (exchangeable && pass.kind_ != CompensateKind::kNone) VENEER_TRY(pass.warm_up());

  GLint alignment = 1;
  glGetIntegerv(GL_SHADER_STORAGE_BUFFER_OFFSET_ALIGNMENT, &alignment);
  const GLintptr needed = kCounterCount * sizeof(std::uint32_t);
  pass.slot_bytes_ = (needed + alignment - 1) / alignment * alignment;
  const GLbitfield mapping = GL_MAP_READ_BIT | GL_MAP_PERSISTENT_BIT | GL_MAP_COHERENT_BIT;
  const auto bytes = static_cast<GLsizeiptr>(kRing) * pass.slot_bytes_;
  pass.counters_ = make_buffer(nullptr, static_cast<std::size_t>(bytes), mapping);
  const auto* mapped =
      static_cast<const std::byte*>(glMapNamedBufferRange(pass.counters_.id(), 0, bytes, mapping));
  if (mapped == nullptr)
    return fail(Errc::kUnavailable,
                "mapping the frame's counters: the driver refuses a persistent mapping");
  for (std::size_t i = 0; i < kRing; ++i) {
    pass.ring_[i].mapped = reinterpret_cast<const volatile std::uint32_t*>(
        mapped + i * static_cast<std::size_t>(pass.slot_bytes_));
  }
  return pass;
}

CompensatePass::~CompensatePass() {
  // Moved-from passes have no program, and their fences went along.
  if (count_program_.id() == 0) return;
  for (const InFlight& slot : ring_) {
    if (slot.fence != nullptr) glDeleteSync(slot.fence);
  }
}

void CompensatePass::compensate(const Bound& bound,
                                std::uint32_t dither_seed,
                                int width,
                                int height) {
  const Program& program = programs_[static_cast<std::size_t>(bound.kind)];
  glBindFramebuffer(GL_FRAMEBUFFER, framebuffer_.id());
  glViewport(0, 0, width, height);
  glDisable(GL_DEPTH_TEST);
  glDisable(GL_BLEND);
  glUseProgram(program.program.id());
  glProgramUniform1ui(program.program.id(), program.seed_location, dither_seed);
  glBindBufferBase(GL_UNIFORM_BUFFER, 1, profile_.constants.id());
  glBindTextureUnit(0, bound.target);
  glBindTextureUnit(1, profile_.vignetting.id());
  glBindTextureUnit(2, profile_.seeds.id());
  glBindTextureUnit(3, profile_.levels.id());
  glBindTextureUnit(4, bound.reflectance);
  if (bound.kind == CompensateKind::kResidual) glBindTextureUnit(5, bound.correction);
  if (has_ceiling_) {
    glBindTextureUnit(6, profile_.light.id());
    glBindTextureUnit(7, bound.residual);
  }
  glBindVertexArray(no_vertices_.id());
  glDrawArrays(GL_TRIANGLES, 0, 3);
}

void CompensatePass::run(GLuint target, std::uint32_t dither_seed) {
  compensate(
      {kind_, target, profile_.reflectance.id(), profile_.correction.id(), profile_.residual.id()},
      dither_seed,
      width_,
      height_);

  const std::size_t index = frame_ % kRing;
  InFlight& slot = ring_[index];
  const GLintptr offset = static_cast<GLintptr>(index) * slot_bytes_;
  const GLuint zero = 0;
  glClearNamedBufferSubData(
      counters_.id(), GL_R32UI, offset, slot_bytes_, GL_RED_INTEGER, GL_UNSIGNED_INT, &zero);
  glUseProgram(count_program_.id());
  glBindTextureUnit(0, codes_.id());
  glBindBufferRange(GL_SHADER_STORAGE_BUFFER, 1, counters_.id(), offset, slot_bytes_);
  glDispatchCompute(groups(width_, kGroupWidth), groups(height_, kGroupHeight), 1);
  glMemoryBarrier(GL_CLIENT_MAPPED_BUFFER_BARRIER_BIT);
  // Whoever did not ask in time loses the counts of four frames ago.
  glDeleteSync(slot.fence);
  slot.fence = glFenceSync(GL_SYNC_GPU_COMMANDS_COMPLETE, 0);
  slot.number = ++frame_;
}

const CompensatePass::Counts& CompensatePass::counts() {
  for (InFlight& slot : ring_) {
    if (slot.fence == nullptr) continue;
    const GLenum state = glClientWaitSync(slot.fence, GL_SYNC_FLUSH_COMMANDS_BIT, 0);
    if (state != GL_ALREADY_SIGNALED && state != GL_CONDITION_SATISFIED) continue;
    glDeleteSync(slot.fence);
    slot.fence = nullptr;
    if (slot.number < newest_counted_) continue;
    newest_counted_ = slot.number;
    const std::uint64_t loss = slot.mapped[3] | static_cast<std::uint64_t>(slot.mapped[4]) << 32U;
    counts_ = {.covered = slot.mapped[0],
               .out_of_gamut = slot.mapped[1],
               .out_of_reach = slot.mapped[2],
               .held = slot.mapped[5],
               .gamut_loss = static_cast<double>(loss) * kLossUnit};
  }
  return counts_;
}

}  // namespace veneer::render
